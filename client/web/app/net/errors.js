// What can come of a request. Pages tell them apart by `kind`.

/** @typedef {'away'|'expired'|'denied'|'not_found'|'conflict'|'invalid'|'busy'|'failed'} ErrorKind */

export class ApiError extends Error {
  /**
   * @param {ErrorKind} kind
   * @param {string} message for a person
   * @param {{status?: number, field?: string, code?: string, current_revision?: number, retry_after_s?: number}} [more]
   */
  constructor(kind, message, more = {}) {
    super(message);
    this.kind = kind;
    Object.assign(this, { status: 0, field: '', code: '', ...more });
  }
}

const kKinds = {
  400: 'invalid',
  401: 'expired',
  403: 'denied',
  404: 'not_found',
  409: 'conflict',
  413: 'invalid',
  415: 'invalid',
  422: 'invalid',
  429: 'busy',
  503: 'busy',
};

/**
 * @param {number} status
 * @param {any} body of the reply, as JSON, or null
 * @param {string|null} retry_after of the header
 */
export function errorOf(status, body, retry_after) {
  const error = body?.error ?? {};
  const text = error.message ?? `The server answered with status ${status} and no words.`;
  return new ApiError(kKinds[status] ?? 'failed', text, {
    status,
    field: error.field ?? '',
    code: error.code ?? '',
    current_revision: error.current_revision ?? body?.current_revision,
    retry_after_s: Number(retry_after) || undefined,
  });
}
