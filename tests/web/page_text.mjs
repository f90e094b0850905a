import { DangerButton } from '../../client/web/app/ui/widgets.js';

/** All text of a tree of elements, marks drawn. A button that asks before it acts has a state: only its own text counts. */
export const textOf = (node) =>
  Array.isArray(node)
    ? node.map(textOf).join('')
    : node?.type === DangerButton
      ? node.props.text
      : typeof node?.type === 'function'
        ? textOf(node.type(node.props))
        : typeof node === 'object'
          ? textOf(node?.props?.children ?? '')
          : typeof node === 'boolean'
            ? ''
            : String(node ?? '');
