// A test double of the server for the console: serves client/web and the REST table from a lab in memory.
// usage: node tests/web/mock_server.mjs [PORT]     log in as mara, ines, root, rhea or anna.bauer; password: correct horse
import { randomBytes } from 'node:crypto';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { kExportFormats } from '../../client/web/app/lib/export_formats.js';
import { layerNames } from '../../client/web/app/lib/tissue.js';
import { makeLab } from './mock/data.mjs';
import { csvOf, kTable, Refusal } from './mock/rest.mjs';
import { acceptWebSocket } from './mock/websocket.mjs';

const kWeb = fileURLToPath(new URL('../../client/web/', import.meta.url));
const kTypes = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml',
};
const kHeaders = {
  'Content-Security-Policy': "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
  'X-Content-Type-Options': 'nosniff',
  'Referrer-Policy': 'no-referrer',
};
const kCookie = '__Host-needlelab',
  kTries = 5,
  kLock_s = 30,
  kLogin_ms = 8 * 3_600_000,
  kTick_ms = 200;

function cookieOf(request) {
  return /(?:^|; )__Host-needlelab=([^;]+)/.exec(request.headers.cookie ?? '')?.[1];
}

function send(response, status, body, headers = {}) {
  const text = typeof body === 'string' ? body : JSON.stringify(body);
  response
    .writeHead(status, { ...kHeaders, 'Content-Type': 'application/json', 'Cache-Control': 'no-store', ...headers })
    .end(text);
}

async function bodyOf(request) {
  const parts = [];
  for await (const part of request) parts.push(part);
  const text = Buffer.concat(parts).toString();
  try {
    return text ? JSON.parse(text) : undefined;
  } catch {
    throw new Refusal(400, 'invalid_input', 'the body is not JSON');
  }
}

function logIn(lab, { name, password }) {
  const failed = lab.failures.get(name) ?? { count: 0, until_ms: 0 };
  const left_s = Math.ceil((failed.until_ms - Date.now()) / 1000);
  if (left_s > 0) throw new Refusal(429, 'rate_limited', `too many tries, wait ${left_s} s`, { retry_after_s: left_s });
  const person = lab.people.get(name);
  if (!person || person.disabled || !person.password || person.password !== password) {
    failed.count++;
    if (failed.count >= kTries) Object.assign(failed, { count: 0, until_ms: Date.now() + kLock_s * 1000 });
    lab.failures.set(name, failed);
    throw new Refusal(401, 'login', 'name or password is wrong');
  }
  lab.failures.delete(name);
  const token = randomBytes(16).toString('hex');
  lab.logins.set(token, {
    name,
    role: person.role,
    full_name: person.full_name,
    csrf_token: randomBytes(16).toString('hex'),
    expires_unix_ms: Date.now() + kLogin_ms,
  });
  return token;
}

/** Only administrators see it; a test may set `lab.disk_room` and `lab.store`. */
const roomFor = (lab, { role }) =>
  role === 'ADMINISTRATOR'
    ? {
        disk_room: lab.disk_room ?? { level: 'plenty', left_bytes: 250e9 },
        store: lab.store ?? { ack_survives: 'a power cut' },
      }
    : {};

/** The downloads' formats, by the last part of the address: 'scores.csv'. */
const kDownloads = Object.fromEntries(
  Object.entries(kExportFormats).flatMap(([name, formats]) => formats.map((f) => [`${name}${f.suffix}`, f])),
);

function find(method, parts) {
  let other = false;
  for (const [wanted, path, roles, handler, status = 200] of kTable) {
    const steps = path.split('/');
    if (steps.length !== parts.length || !steps.every((s, i) => s.startsWith(':') || s === parts[i])) continue;
    if (wanted === method)
      return {
        roles,
        handler,
        status,
        params: Object.fromEntries(
          steps.map((s, i) => [s.slice(1), parts[i]]).filter((_, i) => steps[i].startsWith(':')),
        ),
      };
    other = true;
  }
  throw other
    ? new Refusal(405, 'method', `${method} is not for this path`)
    : new Refusal(404, 'not_found', `there is no /${parts.join('/')}`);
}

async function answer(lab, request, response, url) {
  const parts = url.pathname.split('/').slice(3).map(decodeURIComponent),
    query = Object.fromEntries(url.searchParams);
  const who = lab.logins.get(cookieOf(request));
  if (parts.join('/') === 'session' && request.method === 'POST') {
    const token = logIn(lab, await bodyOf(request));
    const state = lab.logins.get(token);
    return send(
      response,
      200,
      { ...state, ...roomFor(lab, state) },
      {
        'Set-Cookie': `${kCookie}=${token}; Path=/; HttpOnly; Secure; SameSite=Strict`,
      },
    );
  }
  if (!who || who.expires_unix_ms < Date.now()) throw new Refusal(401, 'login', 'log in first');
  if (request.method !== 'GET' && request.headers['x-csrf-token'] !== who.csrf_token)
    throw new Refusal(403, 'csrf', 'X-CSRF-Token is missing or wrong');
  if (parts.join('/') === 'session') {
    if (request.method === 'GET') return send(response, 200, { ...who, ...roomFor(lab, who) });
    lab.logins.delete(cookieOf(request));
    return send(response, 200, {}, { 'Set-Cookie': `${kCookie}=; Path=/; Max-Age=0; Secure` });
  }
  const download = request.method === 'GET' && kDownloads[parts.at(-1)];
  if (download)
    return send(response, 200, csvOf(lab, parts, query), {
      'Content-Type': download.type,
      'Content-Disposition': 'attachment',
    });
  const { roles, handler, status, params } = find(request.method, parts);
  if (!roles.includes(who.role))
    throw new Refusal(403, 'role', `${request.method} /${parts.join('/')} is not for the role ${who.role}`);
  const match = request.headers['if-match'];
  const base = match === undefined ? undefined : Number(match.replaceAll('"', ''));
  return send(response, status, handler({ lab, who, params, query, base, body: await bodyOf(request) }) ?? {});
}

async function file(response, path) {
  const name = normalize(path === '/' ? '/index.html' : path);
  try {
    const body = await readFile(join(kWeb, name));
    response.writeHead(200, { ...kHeaders, 'Content-Type': kTypes[extname(name)] ?? 'text/plain' }).end(body);
  } catch {
    send(response, 404, { error: { code: 'not_found', message: `there is no ${path}` } });
  }
}

function tiles(lab) {
  const t = Date.now() / 1000;
  return [1, 2, 3, 4].map((i) => {
    const s = lab.sessions[i * 5],
      columns = s.gesture.columns,
      at = Math.floor(((t * 1 + i * 3) % s.gesture.length_s) * 100) % columns.t_s.length;
    if (i === 4)
      return {
        station: 'bench-4',
        online: false,
        trainee: '',
        exercise: '',
        phase: 'outside',
        depth_m: 0,
        layer: '',
        force_n: 0,
        peak_force_n: 0,
        fault: '',
        drops: 0,
      };
    const layer = columns.layer[at];
    return {
      station: `bench-${i}`,
      online: true,
      trainee: s.trainee,
      trainee_full_name: lab.people.get(s.trainee)?.full_name ?? '',
      exercise: s.exercise_id,
      phase: ['outside', 'going in', 'at rest', 'coming out'][columns.phase[at]],
      depth_m: columns.insertion_m[at],
      layer: layer < 0 ? '' : layerNames(lab.profiles.get(s.profile_id)[0].json)[layer],
      force_n: Math.abs(columns.fz_n[at]),
      peak_force_n: 2.6,
      fault: i === 3 && t % 20 < 6 ? 'the tip jumped: over 5 m/s since the last good sample' : '',
      drops: i === 2 ? 3 : 0,
    };
  });
}

/**
 * @param {number} port 0: any
 * @returns {Promise<{port: number, lab: any, close: () => Promise<void>}>} `lab.logins.clear()` makes every log-in expire
 */
export async function startMock(port = 0) {
  const lab = makeLab(),
    live = new Set();
  const server = createServer((request, response) => {
    const url = new URL(request.url, 'http://localhost');
    if (!url.pathname.startsWith('/api/v1/')) return file(response, url.pathname);
    return answer(lab, request, response, url).catch((error) => {
      const { status = 500, code = 'internal', more = {} } = error;
      const { retry_after_s, current_revision, ...rest } = more;
      send(
        response,
        status,
        {
          error: {
            code,
            message: error.message,
            ...rest,
            ...(current_revision === undefined ? {} : { current_revision }),
          },
        },
        retry_after_s ? { 'Retry-After': String(retry_after_s) } : {},
      );
    });
  });
  server.on('upgrade', (request, socket) => {
    const who = lab.logins.get(cookieOf(request));
    if (request.url !== '/api/v1/live' || !who) return socket.end('HTTP/1.1 401 Unauthorized\r\n\r\n');
    const say = acceptWebSocket(request, socket);
    live.add(socket);
    const timer = setInterval(() => say(JSON.stringify({ tiles: tiles(lab) })), kTick_ms);
    return socket.on('close', () => {
      clearInterval(timer);
      live.delete(socket);
    });
  });
  await new Promise((resolve, reject) => server.on('error', reject).listen(port, '127.0.0.1', resolve));
  const close = () =>
    new Promise((resolve) => {
      server.close(resolve);
      server.closeAllConnections();
      for (const socket of live) socket.destroy();
    });
  return { port: server.address().port, lab, close };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const { port } = await startMock(Number(process.argv[2] ?? 0));
  console.log(`mock server: http://localhost:${port}/`);
}
