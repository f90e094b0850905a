// Just enough of RFC 6455 for one direction: text frames from the server, and the client's close.
import { createHash } from 'node:crypto';

const kGuid = '258EAFA5-E914-47DA-95CA-C5AB0DC85B11';

/**
 * @param {import('node:http').IncomingMessage} request
 * @param {import('node:stream').Duplex} socket
 * @returns {(text: string) => void} sends a text frame of less than 64 KiB
 */
export function acceptWebSocket(request, socket) {
  const key = createHash('sha1')
    .update(request.headers['sec-websocket-key'] + kGuid)
    .digest('base64');
  socket.write(
    `HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: ${key}\r\n\r\n`,
  );
  socket.on('error', () => socket.destroy());
  socket.on('data', (data) => (data[0] & 0x0f) === 8 && socket.end());
  return (text) => {
    const body = Buffer.from(text);
    const head =
      body.length < 126
        ? Buffer.from([0x81, body.length])
        : Buffer.from([0x81, 126, body.length >> 8, body.length & 255]);
    socket.write(Buffer.concat([head, body]));
  };
}
