// Markup in plain modules: html`<p>…</p>`. Every part of the page gets it from here.
import { h, options, render } from '../../vendor/preact.js';
import htm from '../../vendor/htm.js';
import { visibleText } from '../lib/visible_text.js';

// Each text of a page comes by here (a node without type): hidden characters in names from before are written out. What a field
// holds (`value`) stays as it is.
options.vnode = (node) => {
  if (node.type === null && typeof node.props === 'string') node.props = visibleText(node.props);
};

export const html = htm.bind(h);
export { render };
export {
  useCallback,
  useEffect,
  useId,
  useLayoutEffect,
  useMemo,
  useRef,
  useState,
} from '../../vendor/preact-hooks.js';
