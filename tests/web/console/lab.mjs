// A real laboratory for the tests: server, people, stations, in a folder of its own, on free ports.
import { spawn } from 'node:child_process';
import { closeSync, existsSync, mkdtempSync, openSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const kHere = fileURLToPath(new URL('.', import.meta.url));
export const kBin = process.env.NEEDLELAB_BIN ?? join(kHere, '../../../build/quick/bin');
export const kWebRoot = process.env.NEEDLELAB_WEB_ROOT ?? join(kHere, '../../../client/web');
/** How long a step may take on a slow machine. */
export const kLong_ms = Number(process.env.NEEDLELAB_WAIT_MS ?? 60_000);

export const kPassword = 'correct horse battery';
/** One person of each role, all with kPassword. */
export const kPeople = {
  ada: 'administrator',
  mara: 'curriculum-manager',
  milo: 'curriculum-manager',
  ines: 'instructor',
  rhea: 'researcher',
  tina: 'trainee',
};

/** Repeats `ask` until it gives a true value. @template T @param {() => T | Promise<T>} ask @returns {Promise<T>} */
export async function until(what, ask, limit_ms = kLong_ms) {
  const end = Date.now() + limit_ms;
  for (;;) {
    const answer = await ask();
    if (answer) return answer;
    if (Date.now() > end) throw new Error(`waited ${limit_ms / 1000} s for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

class Program {
  constructor(name, args, log) {
    this.name = name;
    this.log = log;
    const out = openSync(log, 'a', 0o600);
    this.child = spawn(join(kBin, name), args, { stdio: ['ignore', out, out] });
    closeSync(out);
    this.ended = new Promise((resolve) => {
      this.child.on('exit', (code, signal) => {
        this.code = signal ?? code;
        resolve(this.code);
      });
      this.child.on('error', (error) => {
        this.code = String(error);
        resolve(this.code);
      });
    });
  }
  get over() {
    return this.code !== undefined;
  }
  get said() {
    return existsSync(this.log) ? readFileSync(this.log, 'utf8') : '';
  }
}

export class Lab {
  /** @param {string} [data] a data folder that is there, which stays */
  constructor(data) {
    this.folder = mkdtempSync(join(tmpdir(), 'needlelab-console-'));
    this.data = data ?? join(this.folder, 'data');
    this.ports = { stations: 0, web: 0 };
    this.programs = [];
    this.server = null;
    this.password_file = this.write('password', kPassword + '\n');
  }
  path(name) {
    return join(this.folder, name);
  }
  write(name, text) {
    writeFileSync(this.path(name), text, { mode: 0o600 });
    return this.path(name);
  }
  get base() {
    return `https://127.0.0.1:${this.ports.web}/`;
  }

  start(name, args, log) {
    const program = new Program(name, args, this.path(log ?? `${name}.log`));
    this.programs.push(program);
    return program;
  }
  /** needlelab-admin on the folder, while no server runs on it. */
  async admin(...args) {
    const program = this.start('needlelab-admin', ['--data', this.data, ...args], `admin-${this.programs.length}.log`);
    if ((await program.ended) !== 0)
      throw new Error(`needlelab-admin ${args.join(' ')}: exit ${program.code}: ${program.said}`);
    return program.said;
  }

  /** Makes people of all roles and two stations, and starts the server with its sample profiles. */
  async begin() {
    for (const [name, role] of Object.entries(kPeople))
      await this.admin('user', 'add', name, '--role', role, '--password-file', this.password_file);
    for (const station of ['station-1', 'station-2'])
      await this.admin('station', 'add', station, '--out', this.path(`${station}.key`));
    await this.startServer();
  }

  /** Starts the server; after a kill on the same ports. */
  async startServer() {
    const files = { stations: this.path('port'), web: this.path('web-port') };
    for (const file of Object.values(files)) rmSync(file, { force: true });
    const args = [
      '--data',
      this.data,
      '--listen',
      `127.0.0.1:${this.ports.stations}`,
      '--port-file',
      files.stations,
      '--web',
      `127.0.0.1:${this.ports.web}`,
      '--web-port-file',
      files.web,
      '--web-root',
      kWebRoot,
    ];
    this.server = this.start('needlelab-server', args);
    const portIn = (file) => (existsSync(file) ? Number(readFileSync(file, 'utf8').trim()) : 0);
    await until('the server to listen', () => {
      if (this.server.over) throw new Error(`the server ended with ${this.server.code}: ${this.server.said}`);
      return portIn(files.stations) && portIn(files.web);
    });
    this.ports = { stations: portIn(files.stations), web: portIn(files.web) };
  }
  async killServer() {
    this.server.child.kill('SIGKILL');
    await this.server.ended;
  }
  /** @returns {Promise<number|string>} its exit code */
  async stopServer() {
    this.server.child.kill('SIGTERM');
    return this.server.ended;
  }

  /** A trainee at a station with a simulated device and hand. */
  practise(station, trainee, exercise, more = []) {
    const n = this.programs.length;
    return this.start(
      'needlelab-station',
      [
        '--server',
        `127.0.0.1:${this.ports.stations}`,
        '--ca',
        join(this.data, 'tls', 'ca.crt'),
        '--key',
        this.path(`${station}.key`),
        '--spool',
        this.path(`spool-${station}`),
        '--trainee',
        trainee,
        '--exercise',
        exercise,
        '--device',
        'simulated',
        '--headless',
        ...more,
      ],
      `${station}-${trainee}-${n}.log`,
    );
  }

  /** The page that the instructor's program writes about a session. @param {string} session_id */
  async report(session_id) {
    const file = this.path(`report-${session_id}.html`);
    const program = this.start('needlelab-instructor', [
      '--server',
      `127.0.0.1:${this.ports.stations}`,
      '--ca',
      join(this.data, 'tls', 'ca.crt'),
      '--user',
      'ines',
      '--password-file',
      this.password_file,
      '--session',
      session_id,
      '--report',
      file,
    ]);
    if ((await program.ended) !== 0) throw new Error(`the report: exit ${program.code}: ${program.said}`);
    return readFileSync(file, 'utf8');
  }

  /** Ends all processes by their ids and removes the folder. */
  async end(keep = false) {
    for (const program of this.programs) if (!program.over) program.child.kill('SIGKILL');
    await Promise.all(this.programs.map((program) => program.ended));
    if (keep) console.error(`kept: ${this.folder}`);
    else rmSync(this.folder, { recursive: true, force: true });
  }
}
