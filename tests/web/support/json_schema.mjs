// Where a reply differs from the API's description: the part of JSON Schema that server/web/openapi.cpp writes.

const kUnderstood = new Set([
  'type',
  'enum',
  '$ref',
  'properties',
  'required',
  'additionalProperties',
  'items',
  'minimum',
  'maxProperties',
  'format',
  'description',
]);

const kTypes = {
  object: (v) => typeof v === 'object' && v !== null && !Array.isArray(v),
  array: Array.isArray,
  string: (v) => typeof v === 'string',
  boolean: (v) => typeof v === 'boolean',
  number: (v) => typeof v === 'number' && Number.isFinite(v),
  integer: Number.isInteger,
  null: (v) => v === null,
};

/**
 * @param {any} schema
 * @param {any} value
 * @param {any} root of the $refs
 * @returns {string[]} all faults, each with its path
 */
export function schemaFaults(schema, value, root, path = '') {
  const unknown = Object.keys(schema).find((key) => !kUnderstood.has(key));
  if (unknown) return [`${path}: the schema has '${unknown}', which is not understood`];
  if (schema.$ref)
    return schemaFaults(
      schema.$ref
        .slice(2)
        .split('/')
        .reduce((node, key) => node[key], root),
      value,
      root,
      path,
    );
  if (schema.type && ![schema.type].flat().some((type) => kTypes[type](value)))
    return [`${path} is ${JSON.stringify(value)?.slice(0, 60)}, not of type ${schema.type}`];
  if (schema.enum && !schema.enum.includes(value))
    return [`${path} is ${JSON.stringify(value)}, none of ${schema.enum}`];
  if (schema.minimum !== undefined && typeof value === 'number' && value < schema.minimum)
    return [`${path} is too small`];
  if (schema.format === 'uuid' && value !== '' && !/^[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$/.test(value))
    return [`${path} is no UUID: ${value}`];
  if (kTypes.object(value)) return objectFaults(schema, value, root, path);
  // one fault of a list says as much as a thousand
  if (Array.isArray(value) && schema.items)
    return (
      value.map((item, i) => schemaFaults(schema.items, item, root, `${path}[${i}]`)).find((faults) => faults.length) ??
      []
    );
  return [];
}

function objectFaults(schema, value, root, path) {
  const faults = (schema.required ?? []).filter((name) => !(name in value)).map((name) => `${path}.${name} is missing`);
  if (Object.keys(value).length > (schema.maxProperties ?? Infinity)) faults.push(`${path} has members`);
  for (const [name, item] of Object.entries(value)) {
    const known = schema.properties?.[name];
    const rule = known ?? schema.additionalProperties;
    if (rule === false) faults.push(`${path}.${name} is not described`);
    else if (typeof rule === 'object' && item !== undefined)
      faults.push(...schemaFaults(rule, item, root, `${path}.${name}`));
  }
  return faults;
}

/** The schema of a reply; undefined: none of that status, or not JSON. */
export function replySchema(api, method, pattern, status) {
  const responses = api.paths[pattern]?.[method.toLowerCase()]?.responses;
  const reply = responses?.[status] ?? (status >= 300 ? responses?.default : undefined);
  return reply?.content?.['application/json']?.schema;
}
