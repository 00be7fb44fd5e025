// A server of SplatBus 1.0 in a hundred lines, as one writes it who wants to see something soon.
'use strict';

const net = require('net');

const CAMERAS = [
  {position: [0, 0, -4], rotation: [0, 0, 0, 1]},
  {position: [1, 0.5, -3.5], rotation: [0, 0.6, 0, 0.8]},
  {position: [-2, 0, -3], rotation: [0.5, 0.5, 0.5, 0.5]},
];
const IDENTITY = {position: [0, 0, 0], rotation: [0, 0, 0, 1]};
const LARGEST = 1048576;
let control = null;
const poses = {};

function send(socket, text) {
  const header = Buffer.alloc(4);
  header.writeUInt32LE(Buffer.byteLength(text));
  socket.write(header);
  socket.write(text);
}

function isPose({position, rotation}) {
  if (!position || !rotation) return false;
  const {x, y, z} = position;
  const numbers = [x, y, z, rotation.x, rotation.y, rotation.z, rotation.w];
  if (!numbers.every((each) => typeof each === 'number')) return false;
  if ([x, y, z].some((each) => Math.abs(each) > 3.4028234663852886e38)) return false;
  return Math.abs(Math.hypot(...numbers.slice(3)) - 1) <= 0.01;
}

function handle(socket, text) {
  let message;
  try { message = JSON.parse(text); } catch (error) { return; }
  if (message === null || typeof message !== 'object' || Array.isArray(message)) return;
  switch (message.type) {
    case 'get_viewport_size':
      send(socket, '{"viewport_size":[640.0,480.0]}');
      break;
    case 'get_camera_pose':
      if (!Number.isSafeInteger(message.cam_idx)) return;
      send(socket, JSON.stringify(CAMERAS[message.cam_idx % CAMERAS.length] || IDENTITY));
      break;
    case 'camera_pose':
    case 'point_cloud_pose':
      if (!isPose(message)) return;
      if (control === null || control.destroyed) control = socket;
      if (control === socket) poses[message.type] = message;
      send(socket, '{"ok":true}');
      break;
  }
}

function listen(port, speaks) {
  net.createServer({allowHalfOpen: true}, (socket) => {
    let had = Buffer.alloc(0);
    let deadline = null;
    socket.on('data', (chunk) => {
      clearTimeout(deadline);
      had = had.length ? Buffer.concat([had, chunk]) : chunk;
      while (had.length >= 4) {
        const length = had.readUInt32LE(0);
        if (length === 0 || length > LARGEST) return socket.destroy();
        if (had.length < 4 + length) break;
        if (speaks) handle(socket, had.toString('utf8', 4, 4 + length));
        had = had.subarray(4 + length);
      }
      if (had.length) deadline = setTimeout(() => socket.destroy(), 10000);
    });
    socket.on('end', () => socket.end());
    socket.on('error', () => socket.destroy());
    socket.on('close', () => clearTimeout(deadline));
  }).listen(port, process.env.SPLATBUS_HOST || '127.0.0.1');
}

listen(Number(process.env.SPLATBUS_IPC_PORT || 6001), false);
listen(Number(process.env.SPLATBUS_MSG_PORT || 6000), true);
