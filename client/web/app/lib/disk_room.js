// The levels of free space on the disk of the server's database (server/live/limits/disk_room.h), and what to do at
// each.

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
