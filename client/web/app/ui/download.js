// A file that is put together here from all pages of a list: a plain link would save the first page only, or an error as the file.
import { useAction } from './hooks.js';
import { html } from './html.js';
import { Problem } from './parts.js';

export function saveAs(file, text, type) {
  const link = Object.assign(document.createElement('a'), {
    href: URL.createObjectURL(new Blob([text], { type })),
    download: file,
  });
  link.click();
  URL.revokeObjectURL(link.href);
}

/**
 * @param {{file: string, make: () => Promise<any>, children: any}} props `make` gives what is saved as JSON
 */
export function JsonDownload({ file, make, children }) {
  const action = useAction();
  const save = async () => {
    const document_ = await action.run(make);
    if (!document_) return;
    saveAs(file, JSON.stringify(document_, null, 1), 'application/json');
  };
  return html`
    <button type="button" disabled=${action.busy} onClick=${save}>${action.busy ? 'Collecting …' : children}</button>
    <${Problem} error=${action.error} />
  `;
}
