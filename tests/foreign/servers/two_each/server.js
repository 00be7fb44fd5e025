// A server of SplatBus 1.0 that keeps two connections on each channel: a third one ends the oldest
// (CHN-13). Its images are in no CUDA memory, so nothing is sent on the IPC channel (CHN-5).
'use strict';

const net = require('net');

const HOST = process.env.SPLATBUS_HOST || '127.0.0.1';
const KEPT = 2;
const LARGEST = 1048576;
const DEEPEST = 64;
const FLOAT_MAX = 3.4028234663852886e38;
const ENOUGH_UNSENT = 65536;

const SIZE = [1920, 1080];
const CAMERAS = [
  {position: [0, 0, -5], rotation: [0, 0, 0, 1]},
  {position: [2.5, -1, -4.75], rotation: [0, -0.28, 0, 0.96]},
  {position: [-3, 0.5, 0.125], rotation: [0.5, 0.5, 0.5, 0.5]},
  {position: [0.1, 0.2, 0.3], rotation: [0.7071067811865476, 0, 0, 0.7071067811865476]},
];
const scene = {control: null, speakers: [], poses: {}};

class Refused extends Error {}

// JSON by RFC 8259 and JSN-1 to JSN-5: JSON.parse takes names twice, 1e400 and half a surrogate.
function understood(payload) {
  const text = new TextDecoder('utf-8', {fatal: true, ignoreBOM: true}).decode(payload);
  let at = 0;
  const refuse = () => { throw new Refused(`at ${at}`); };
  const space = () => { while (at < text.length && ' \t\n\r'.includes(text[at])) at += 1; };
  const take = (token) => text.startsWith(token, at) && ((at += token.length), true);

  function string() {
    const found = /"(?:[^"\\\u0000-\u001f]|\\(?:["\\/bfnrt]|u[0-9a-fA-F]{4}))*"/y;
    found.lastIndex = at;
    const match = found.exec(text);
    if (!match) refuse();
    at = found.lastIndex;
    const value = JSON.parse(match[0]);
    if (/[\ud800-\udbff](?![\udc00-\udfff])|(?<![\ud800-\udbff])[\udc00-\udfff]/.test(value)) refuse();
    return value;
  }

  function number() {
    const found = /-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?/y;
    found.lastIndex = at;
    const match = found.exec(text);
    if (!match) refuse();
    at = found.lastIndex;
    const value = Number(match[0]);
    if (!Number.isFinite(value)) refuse();
    return value;
  }

  function value(depth) {
    space();
    if (text[at] === '"') return string();
    if (take('true')) return true;
    if (take('false')) return false;
    if (take('null')) return null;
    if (depth >= DEEPEST && '[{'.includes(text[at])) refuse();
    if (take('[')) {
      const found = [];
      space();
      if (take(']')) return found;
      do { found.push(value(depth + 1)); space(); } while (take(','));
      if (!take(']')) refuse();
      return found;
    }
    if (take('{')) {
      const found = new Map();
      space();
      if (take('}')) return found;
      do {
        space();
        const name = string();
        space();
        if (found.has(name) || !take(':')) refuse();
        found.set(name, value(depth + 1));
        space();
      } while (take(','));
      if (!take('}')) refuse();
      return found;
    }
    return number();
  }

  const whole = value(0);
  space();
  if (at !== text.length || !(whole instanceof Map)) refuse();
  return whole;
}

function numbers(of, names) {
  if (!(of instanceof Map)) throw new Refused('no object');
  return [...names].map((name) => {
    const value = of.get(name);
    if (typeof value !== 'number') throw new Refused(name);
    return value;
  });
}

function pose(message, socket) {
  const position = numbers(message.get('position'), 'xyz');
  const rotation = numbers(message.get('rotation'), 'xyzw');
  if (position.some((each) => Math.abs(each) > FLOAT_MAX)) throw new Refused('position');
  if (Math.abs(Math.hypot(...rotation) - 1) > 0.01) throw new Refused('rotation');
  if (!scene.speakers.includes(socket)) scene.speakers.push(socket);
  if (scene.speakers[0] === socket) scene.poses[message.get('type')] = {position, rotation};
}

function replyTo(message, socket) {
  switch (message.get('type')) {
    case 'camera_pose':
    case 'point_cloud_pose':
      pose(message, socket);
      return null;
    case 'get_viewport_size':
      return {viewport_size: SIZE};
    case 'get_camera_pose': {
      const index = message.get('cam_idx');
      if (!Number.isSafeInteger(index)) throw new Refused('cam_idx');
      return CAMERAS[((index % CAMERAS.length) + CAMERAS.length) % CAMERAS.length];
    }
    default:
      return null;
  }
}

function send(socket, reply) {
  const payload = Buffer.from(JSON.stringify(reply));
  const header = Buffer.alloc(4);
  header.writeUInt32LE(payload.length);
  socket.write(Buffer.concat([header, payload]));
}

function handle(payload, socket) {
  let reply = null;
  try {
    reply = replyTo(understood(payload), socket);
  } catch (error) {
    if (!(error instanceof Refused || error instanceof TypeError)) throw error;
  }
  if (reply) send(socket, reply);
}

function attend(socket, speaks) {
  let chunks = [];
  let size = 0;
  let deadline = null;
  let stalled = null;
  socket.setNoDelay(true);

  function gathered(count) {
    if (chunks.length > 1 && chunks[0].length < count) chunks = [Buffer.concat(chunks)];
    return chunks[0];
  }

  function work() {
    clearTimeout(deadline);
    deadline = null;
    while (size >= 4 && !socket.isPaused()) {
      const length = gathered(4).readUInt32LE(0);
      if (length < 1 || length > LARGEST) { socket.destroy(); return; }
      if (size < 4 + length) break;
      const whole = gathered(4 + length);
      chunks[0] = whole.subarray(4 + length);
      size -= 4 + length;
      if (speaks) handle(whole.subarray(4, 4 + length), socket);
      if (socket.writableLength > ENOUGH_UNSENT) {
        socket.pause();
        stalled = setTimeout(() => socket.destroy(), 5000);
      }
    }
    if (size > 0 && !socket.isPaused()) deadline = setTimeout(() => socket.destroy(), 10000);
  }

  socket.on('data', (chunk) => { chunks.push(chunk); size += chunk.length; work(); });
  socket.on('drain', () => {
    if (stalled === null) return;
    clearTimeout(stalled);
    stalled = null;
    socket.resume();
    work();
  });
  socket.on('end', () => socket.end());
  socket.on('error', () => socket.destroy());
  socket.on('close', () => {
    clearTimeout(deadline);
    clearTimeout(stalled);
    scene.speakers = scene.speakers.filter((each) => each !== socket);
  });
}

function listen(port, speaks) {
  const open = [];
  const server = net.createServer({allowHalfOpen: true}, (socket) => {
    open.push(socket);
    if (open.length > KEPT) open.shift().destroy();
    socket.on('close', () => { if (open.includes(socket)) open.splice(open.indexOf(socket), 1); });
    attend(socket, speaks);
  });
  server.listen(port, HOST);
}

listen(Number(process.env.SPLATBUS_IPC_PORT || 6001), false);
listen(Number(process.env.SPLATBUS_MSG_PORT || 6000), true);
