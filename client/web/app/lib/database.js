// The state of the server's database: what an acknowledgement survives (db/engine/engine.h), whether changes are stored,
// the free space on its disk (server/live/limits/disk_room.h); what each means, and what to do.

/** @typedef {{kind: 'good'|'info'|'warn'|'bad', means: string, next: string}} Durability */
/** @type {Object<string, Durability>} By the server's words, weakest first. */
export const kDurabilities = {
  nothing: {
    kind: 'bad',
    means: 'The database confirms before it has written: its last moments are lost when its program ends.',
    next: 'Set synchronous_commit = on in PostgreSQL.',
  },
  'the end of a program': {
    kind: 'bad',
    means: 'A power cut can lose what the server has confirmed, or damage the database.',
    next: 'Set fsync = on and full_page_writes = on in PostgreSQL.',
  },
  'a power cut': {
    kind: 'info',
    means:
      'What the server has confirmed is on one disk and is lost with it. Stations keep each recording until a verified backup on another disk has it.',
    next: 'Make such backups every night. On PostgreSQL a named standby confirms, too: synchronous_standby_names.',
  },
  'the loss of a disk': {
    kind: 'good',
    means: 'What the server has confirmed is on two disks: that of the database and that of a standby.',
    next: 'Nothing to do.',
  },
};

/** The words' row; words that this console does not know count as bad. */
export function durability(ack_survives) {
  return (
    kDurabilities[ack_survives] ?? {
      kind: 'bad',
      means: 'This console does not know what that means.',
      next: 'The server’s log says more (durability).',
    }
  );
}

/** What is missing, and what to do; undefined if the database has everything that was confirmed. */
export function missing({ lack }) {
  if (lack === undefined) return undefined;
  return {
    kind: 'bad',
    name: 'confirmed recordings are missing',
    means: lack,
    next: 'FACULTY.md has the steps ("The wrong standby was promoted"). This message stays until the server is restarted.',
  };
}

/** What is wrong, and what to do; undefined if changes are stored. */
export function storingTrouble({ refused, waits_s }) {
  if (refused !== undefined)
    return {
      kind: 'bad',
      name: 'not stored',
      means: `The database did not store a change: ${refused}. The stations keep what they record.`,
      next: 'Check that PostgreSQL and its standby run, the disk has room and the server’s role has its rights; the server then continues by itself.',
    };
  if (waits_s !== undefined)
    return {
      kind: 'warn',
      name: 'waits',
      means: `The database has not confirmed a change for ${Math.round(waits_s)} s. The stations keep what they record.`,
      next: 'Check whether the standby runs and reaches the database: until it confirms, nothing counts as stored.',
    };
  return undefined;
}

/** @typedef {{kind: 'good'|'warn'|'bad', name: string, means: string, next: string}} RoomLevel */
/** @type {Object<string, RoomLevel>} */
export const kRoomLevels = {
  plenty: {
    kind: 'good',
    name: 'enough room',
    means: 'Everything is stored.',
    next: 'Nothing to do.',
  },
  no_new_sessions: {
    kind: 'warn',
    name: 'new sessions refused',
    means: 'Running lessons are stored to their end. The stations keep new ones and send them when there is room.',
    next: 'Make room on the disk, or let retention delete old recordings.',
  },
  no_chunks: {
    kind: 'bad',
    name: 'recordings refused',
    means: 'No recording is stored. The stations keep them and send them when there is room.',
    next: 'Make room on the disk at once, or let retention delete old recordings.',
  },
  read_only: {
    kind: 'bad',
    name: 'read only',
    means: 'The disk was too full at the start: recordings can be read and exported, nothing can be changed.',
    next: 'Make room on the disk: the server then stops by itself, and its service restarts it for writing.',
  },
};

/** The level's row; a level that this console does not know counts as bad. */
export function roomLevel(level) {
  return (
    kRoomLevels[level] ?? {
      kind: 'bad',
      name: String(level),
      means: 'The server refuses something for lack of disk space.',
      next: 'Make room on the disk.',
    }
  );
}
