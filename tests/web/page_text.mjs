/** All text of a tree of elements, marks drawn. */
export const textOf = (node) =>
  Array.isArray(node)
    ? node.map(textOf).join('')
    : typeof node?.type === 'function'
      ? textOf(node.type(node.props))
      : typeof node === 'object'
        ? textOf(node?.props?.children ?? '')
        : typeof node === 'boolean'
          ? ''
          : String(node ?? '');
