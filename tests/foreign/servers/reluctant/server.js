"use strict";
// A renderer behind a slow line: a floor of waves, drawn five times a second at most, told late and in bundles.
const fs = require("fs");
const net = require("net");
const { parsed, isInt, isObject, isNumber } = require("../one_session/text");

const SLOTS = 64, LATE = 300, MOST = 1 << 20, SAFE = Number.MAX_SAFE_INTEGER, NEAR = 0.05, FAR = 60;
const MINE = { ipc: ["frames", "reinit", "host_shm"], msg: ["viewport", "ping"] };
const FOLDER = "/dev/shm/", FAMILY = "reluctant-";
const now = () => Number(process.hrtime.bigint()) / 1e9;

// ---- memory

for (const name of fs.readdirSync(FOLDER)) {
  const match = /^reluctant-(\d+)-\d+$/.exec(name);
  if (!match) continue;
  try { process.kill(+match[1], 0); } catch (error) {
    if (error.code === "ESRCH") fs.rmSync(FOLDER + name, { force: true }); // another may be as quick
  }
}

let generation = 4710, memory = null;
const former = new Set();

function made(w, h) {
  const name = `${FAMILY}${process.pid}-${generation + 1}`, gap = 4096;
  const colorStride = 16 * w * h + 64, depthStride = 4 * w * h + 16 * 3;
  const depthOffset = gap, colorOffset = gap + SLOTS * depthStride;
  const bytes = Math.ceil((colorOffset + SLOTS * colorStride) / 16) * 16 + 5;
  const file = fs.openSync(FOLDER + name, "wx+", 0o600);
  fs.writeSync(file, Buffer.alloc(bytes), 0, bytes, 0);
  generation += 1;
  return { generation, file, name, w, h, images: 0, holders: new Set(),
    ring: { slots: SLOTS, depthStride, colorStride, colorOffset, depthOffset }, bytes };
}

function freed(it) {
  former.delete(it);
  fs.closeSync(it.file);
  fs.unlinkSync(FOLDER + it.name);
}

const initOf = (it) => ({
  generation: it.generation, version: "1.1", "x-reluctant-note": "memory of the host",
  meta: { h: it.h, w: it.w, fmtDepth: "R32F", fmtColor: "RGBA32F", pitchDepth: 4 * it.w, pitchColor: 16 * it.w },
  memory: { bytes: it.bytes, kind: "host_shm", name: it.name }, ring: it.ring,
  semantics: { rows: "bottom_up", alpha: "straight", colorSpace: "linear", unitMetres: 0.25, origin: [1e5, 0, -2.5],
    depth: { kind: "ray_distance", estimator: "median", empty: 0 } },
});

// ---- images

const IDENTITY = { position: [0, 0, 0], rotation: [0, 0, 0, 1] };
const scene = { camera: { position: [0, -1, -2], rotation: [0, 0, 0, 1] }, floor: IDENTITY, number: 0, tag: undefined };
let image = null, seq = 1000, changed = true;

function matrix([x, y, z, w]) {
  const s = 2 / (x * x + y * y + z * z + w * w);
  return [
    [(s / 2) * (w * w + x * x - y * y - z * z), s * (x * y - z * w), s * (x * z + y * w)],
    [s * (x * y + z * w), (s / 2) * (w * w - x * x + y * y - z * z), s * (y * z - x * w)],
    [s * (x * z - y * w), s * (y * z + x * w), (s / 2) * (w * w - x * x - y * y + z * z)],
  ];
}
const times = (m, v) => m.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
const transposed = (m) => [0, 1, 2].map((i) => m.map((row) => row[i]));

function lens(w, h) { return { fx: 0.9 * w, fy: 0.9 * w, cx: w / 2, cy: h / 2, width: w, height: h, near: NEAR, far: FAR }; }

function draw(it, slot) {
  const { w, h, ring, file } = it, { fx, fy, cx, cy } = lens(w, h), { camera, floor } = scene;
  const look = matrix(camera.rotation), into = transposed(matrix(floor.rotation));
  const from = times(into, camera.position.map((c, i) => c - floor.position[i]));
  const color = new Float32Array(4 * w * h), depth = new Float32Array(w * h);
  for (let row = 0; row < h; row++) for (let j = 0; j < w; j++) {
    const ray = [(j + 0.5 - cx) / fx, (h - 1 - row + 0.5 - cy) / fy, 1];
    const along = times(into, times(look, ray)), z = (1 - from[1]) / along[1], k = row * w + j;
    if (!(z >= NEAR && z <= FAR)) continue;
    const x = from[0] + z * along[0], y = from[2] + z * along[2];
    color.set([0.5 + 0.4 * Math.sin(1.5 * x), 0.5 + 0.4 * Math.sin(y), 0.25, 0.75], 4 * k);
    depth[k] = z * Math.hypot(...ray);
  }
  fs.writeSync(file, color, 0, color.byteLength, ring.colorOffset + slot * ring.colorStride);
  fs.writeSync(file, depth, 0, depth.byteLength, ring.depthOffset + slot * ring.depthStride);
}

function render() {
  if (!changed) return;
  changed = false;
  const lent = new Set([...doors.ipc.open].filter((c) => c.lease && c.lease.of === memory).map((c) => c.lease.slot));
  const kept = image && image.of === memory ? image.slot : -1;
  let slot = (kept + 1) % SLOTS;
  while (lent.has(slot) || slot === kept) slot = (slot + 1) % SLOTS;
  draw(memory, slot);
  seq += 1 + Math.floor(3 * Math.random());
  const { camera, floor, number, tag } = scene;
  image = { of: memory, slot, seq, camera, floor, number, tag, at: now() };
  doors.ipc.open.forEach(lend);
}

function lend(conn) {
  if (!image || image.of !== memory || conn.opened !== memory.generation || conn.lease || conn.seq >= image.seq || conn.over) return;
  if (!conn.can || !conn.can.includes("frames")) return;
  const { slot, seq: number, camera, floor } = image;
  const message = { type: "frame", generation: memory.generation, slot, seq: number, time: 0, renderedAt: image.at,
    camera: { ...camera, ...lens(memory.w, memory.h) } };
  if (image.tag !== undefined && image.number > conn.number) message.camera.tag = image.tag;
  if (JSON.stringify(floor) !== JSON.stringify(IDENTITY)) message.objects = [{ object: "default", ...floor, scale: 1 }];
  Object.assign(conn, { lease: image, seq: number, number: image.number });
  conn.say(message);
}

// ---- connections

const doors = { ipc: { open: new Set(), queue: [], most: 8, take: onIpc }, msg: { open: new Set(), queue: [], most: 1, take: onMessage } };

function serve(name, socket) {
  const door = doors[name];
  const conn = { seq: -1, number: 0, later: [], sent: new Map(), timers: new Set(), over: false, socket };
  let buffer = Buffer.alloc(0), half = null, stuck = null;
  socket.setNoDelay(true);
  conn.write = (messages) => {
    const packets = messages.flatMap((message) => {
      const text = Buffer.from(JSON.stringify(message)), header = Buffer.alloc(4);
      header.writeUInt32LE(text.length);
      return [header, text];
    });
    if (socket.destroyed || socket.writableEnded) return;
    if (!socket.write(Buffer.concat(packets)) && !stuck) stuck = setTimeout(() => conn.drop(), 4500);
    if (socket.writableLength > MOST) conn.drop();
  };
  socket.on("drain", () => { clearTimeout(stuck); stuck = null; });
  conn.say = (message) => { conn.write([message]); };
  conn.bundle = (message) => { // with all else of these ten milliseconds, and late
    conn.later.push([Date.now() + LATE, message]);
    if (conn.later.length === 1) conn.flush();
  };
  conn.flush = () => {
    const due = conn.later.filter(([at]) => at <= Date.now()).length;
    if (due) conn.write(conn.later.splice(0, due).map(([, message]) => message));
    if (conn.later.length) setTimeout(conn.flush, Math.max(10, conn.later[0][0] - Date.now()));
    else if (conn.ending) conn.finish();
  };
  conn.finish = () => { conn.ending = true; if (!conn.later.length) socket.end(); };
  conn.refuse = (error) => { // says why, listens on a little, and goes
    conn.over = true;
    conn.bundle(error);
    conn.ending = true;
    setTimeout(conn.drop, 4500);
  };
  conn.drop = () => socket.destroy();
  socket.on("error", () => {});
  socket.on("end", conn.finish);
  socket.on("close", () => {
    clearTimeout(half); clearTimeout(stuck);
    conn.timers.forEach(clearTimeout);
    const heir = door.open.delete(conn) && door.queue.shift();
    if (heir) heir();
    [...former].forEach((it) => { it.holders.delete(conn); if (!it.holders.size) freed(it); });
    if (memory) memory.holders.delete(conn);
  });
  const heard = () => socket.on("data", (data) => {
    if (conn.over) return;
    buffer = Buffer.concat([buffer, data]);
    let whole = false;
    while (buffer.length >= 4 && !conn.over) {
      const length = buffer.readUInt32LE(0);
      if (length < 1 || length > MOST) return conn.drop();
      if (buffer.length < 4 + length) break;
      const payload = buffer.subarray(4, 4 + length);
      buffer = buffer.subarray(4 + length);
      whole = true;
      let message;
      try { message = parsed(payload); } catch (error) { continue; }
      door.take(conn, message);
    }
    if (whole || !buffer.length) { clearTimeout(half); half = null; }
    if (buffer.length && !half) half = setTimeout(conn.drop, 9700);
  });
  const enter = () => { door.open.add(conn); heard(); };
  if (door.open.size < door.most) return enter();
  if (door.queue.length >= 4) return conn.drop();
  const patience = setTimeout(conn.drop, 1000); // for the place, should it become free
  const wait = () => { clearTimeout(patience); enter(); };
  door.queue.push(wait);
  socket.prependListener("close", () => { clearTimeout(patience); door.queue = door.queue.filter((each) => each !== wait); });
}

const isText = (value, least, most) => typeof value === "string" && [...value].length >= least && [...value].length <= most;
const isList = (value, least, most) => Array.isArray(value) && value.length >= least && value.length <= most;

function isHello({ versions, client, capabilities, token }) {
  return isList(versions, 1, 16) && versions.every((each) => isText(each, 3, 64) && /^(0|[1-9]\d*)\.(0|[1-9]\d*)$/.test(each)) &&
    isObject(client) && isText(client.name, 0, 64) && isText(client.version, 0, 64) && isList(capabilities, 0, 64) &&
    capabilities.every((each) => isText(each, 0, 64)) && new Set(capabilities).size === capabilities.length &&
    (token === undefined || isText(token, 1, 256));
}

function greet(conn, name, message) {
  if (conn.greeted) return;
  conn.greeted = true;
  const fail = (code, more) => conn.refuse({ type: "error", message: "", code, ...more });
  if (!isHello(message)) return fail("invalid_message");
  const version = message.versions.find((each) => each === "1.0" || each === "1.1");
  if (!version) return fail("unsupported_version", { supported: ["1.1", "1.0"] });
  conn.can = version === "1.1" ? MINE[name].filter((each) => message.capabilities.includes(each)) : [];
  conn.modern = version === "1.1";
  const welcome = { capabilities: conn.can, server: { version: "", name: "reluctant" }, version, type: "welcome" };
  if (name === "msg") return conn.bundle(welcome);
  const out = [welcome];
  if (conn.can.includes("host_shm")) {
    out.push(...announced(conn));
  }
  conn.write(out);
}

function announced(conn) {
  conn.told = true;
  conn.sent.set(memory.generation, memory);
  memory.holders.add(conn);
  return [initOf(memory)];
}

function onIpc(conn, message) {
  const { type, generation: named } = message;
  if (type === "hello") return greet(conn, "ipc", message);
  const it = conn.sent.get(named);
  if (!it) return;
  if (type === "opened") {
    conn.opened = named;
    lend(conn);
  } else if (type === "open_failed" || type === "closed") {
    if (conn.lease && conn.lease.of === it) conn.lease = null;
    if (conn.opened === named) conn.opened = null;
    conn.sent.delete(named);
    it.holders.delete(conn);
    if (former.has(it) && !it.holders.size) freed(it);
    lend(conn);
  } else if (type === "release" && conn.lease && conn.lease.of === it && conn.lease.seq === message.seq) {
    conn.lease = null;
    lend(conn);
  }
}

const numbers = (value, names) => {
  const list = isObject(value) ? [...names].map((name) => value[name]) : [];
  return list.length && list.every(isNumber) ? list : null;
};

function move(conn, message) {
  const position = numbers(message.position, "xyz"), rotation = numbers(message.rotation, "xyzw");
  const camera = message.type === "camera_pose", { tag, timestamp } = message;
  if (!position || !rotation || (timestamp !== undefined && !isNumber(timestamp))) return refused(conn, "invalid_message");
  if (position.some((each) => Math.abs(each) > 3.4028234663852886e38)) return refused(conn, "invalid_number");
  if (Math.abs(Math.hypot(...rotation) - 1) > 0.01) return refused(conn, "invalid_rotation");
  if (conn.modern && camera && tag !== undefined && !isText(tag, 1, 64)) return refused(conn, "invalid_message");
  const pose = { position, rotation }, before = camera ? scene.camera : scene.floor;
  if (position.some((each, i) => each !== before.position[i]) || rotation.some((each, i) => each !== before.rotation[i])) changed = true;
  if (!camera) { scene.floor = pose; return; }
  Object.assign(scene, { camera: pose, tag: conn.modern ? tag : undefined, number: scene.number + 1 });
}

function refused(conn, code) { if (conn.modern) conn.bundle({ type: "error", code, message: "not so" }); }

const CAMERAS = [scene.camera, { position: [2, -2, -2], rotation: [-0.36, 0.48, 0, 0.8] }];

function onMessage(conn, message) {
  const { type, id } = message;
  if (type === "hello") return greet(conn, "msg", message);
  if (type === "camera_pose" || type === "point_cloud_pose") return move(conn, message);
  if (!["get_viewport_size", "get_camera_pose", "get_scene", "set_viewport", "ping"].includes(type)) return;
  const named = conn.modern && isInt(id, 0, SAFE) ? { id } : {};
  const wrong = (code) => { if (conn.greeted && conn.modern) conn.bundle({ type: "error", code, message: "no", ...named }); };
  const reply = (kind, members) => conn.bundle(conn.modern ? { ...members, type: kind, ...named } : members);
  if (conn.modern && id !== undefined && !isInt(id, 0, SAFE)) return wrong("invalid_message");
  if (type === "get_viewport_size") return reply("viewport_size", { viewport_size: image ? [memory.w, memory.h] : [0, 0] });
  if (type === "get_camera_pose") {
    if (!isInt(message.cam_idx, -SAFE, SAFE)) return wrong("invalid_message");
    return reply("camera", CAMERAS[((message.cam_idx % 2) + 2) % 2]);
  }
  if (type === "get_scene" || !conn.can || !conn.can.includes(type === "ping" ? "ping" : "viewport")) return wrong("unsupported");
  if (type === "ping") return isNumber(message.t) ? reply("pong", { serverTime: now(), t: message.t }) : wrong("invalid_message");
  const { width, height } = message;
  if (!isInt(width, 1, 32768) || !isInt(height, 1, 32768)) return wrong("invalid_message");
  if (width === memory.w && height === memory.h) return reply("viewport_size", { viewport_size: [width, height] });
  if (former.size) return wrong("busy");
  const readers = [...doors.ipc.open].filter((each) => each.told);
  if (readers.some((each) => !each.can.includes("reinit"))) return wrong("unsupported");
  if (width % 16 || height % 4 || width * height > 160 * 120) return wrong("unsupported");
  const old = memory;
  try { memory = made(width, height); } catch (error) { return wrong("unsupported"); }
  former.add(old);
  changed = true;
  for (const each of doors.ipc.open) {
    if (!each.told) continue;
    each.write(announced(each));
    each.timers.add(setTimeout(() => { if (each.sent.has(old.generation)) each.drop(); }, 10000));
  }
  if (!old.holders.size) freed(old);
  reply("viewport_size", { viewport_size: [width, height] });
}

// ---- life

memory = made(48, 36);
setInterval(render, 200);
for (const [name, variable, usual] of [["ipc", "SPLATBUS_IPC_PORT", 6001], ["msg", "SPLATBUS_MSG_PORT", 6000]]) {
  net.createServer({ allowHalfOpen: true }, (socket) => serve(name, socket))
    .listen(+(process.env[variable] || usual), "127.0.0.1");
}
process.on("exit", () => [memory, ...former].forEach((it) => { try { freed(it); } catch (error) { /* gone already */ } }));
["SIGINT", "SIGTERM", "SIGHUP"].forEach((signal) => process.on(signal, () => process.exit(0)));
