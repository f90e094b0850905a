// The levels of free space on the disk of the server's database (server/live/limits/disk_room.h), and what to do at
// each.

/** @typedef {{kind: 'good'|'warn'|'bad', name: string, means: string, next: string}} RoomLevel */
/** @type {Object<string, RoomLevel>} */
export const kRoomLevels = {
  plenty: {
    kind: 'good',
    name: 'enough room',
    means: 'Everything is stored.',
    next: 'Nothing is to be done.',
  },
  no_new_sessions: {
    kind: 'warn',
    name: 'new sessions refused',
    means: 'Lessons that run are stored to their end. The stations keep new ones and send them when there is room.',
    next: 'Make room on the disk, or let retention delete old recordings.',
  },
  no_chunks: {
    kind: 'bad',
    name: 'recordings refused',
    means: 'Nothing recorded is stored. The stations keep it and send it when there is room.',
    next: 'Make room on the disk at once, or let retention delete old recordings.',
  },
  read_only: {
    kind: 'bad',
    name: 'read only',
    means: 'The disk was too full at the start: recordings can be read and exported, nothing can be changed.',
    next: 'Make room on the disk: the server ends by itself then, and its service starts it again for writing.',
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
