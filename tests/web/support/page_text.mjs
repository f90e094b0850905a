import { DangerButton } from '../../../client/web/app/ui/widgets.js';

/** All elements of a tree, components drawn but for those in `kept`, whose properties are what they are given. */
export const elementsOf = (node, kept = []) =>
  Array.isArray(node)
    ? node.flatMap((one) => elementsOf(one, kept))
    : typeof node !== 'object' || node === null
      ? []
      : typeof node.type === 'function' && !kept.includes(node.type)
        ? elementsOf(node.type(node.props), kept)
        : [node, ...elementsOf(node.props?.children, kept)];

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
