// Markup in plain modules: html`<p>…</p>`. Every part of the page gets it from here.
import { h, options, render } from '../../vendor/preact.js';
import htm from '../../vendor/htm.js';
import { visibleText } from '../lib/visible_text.js';

// Each text of a page passes through here (a node without type): writes out hidden characters in older names. A field's
// contents (`value`) stay as they are.
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
