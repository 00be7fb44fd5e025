import { Frame, FRAMING, HostShmMemory, InitPacket, IpcFromServer, LIMITS, Series } from "./types";

export function told(message: IpcFromServer): string {
  switch (message.type) {
    case "frame": return `${message.seq} ${message.camera.tag ?? ""}`;
    case "error": return message.code === "busy" ? "later" : message.message;
    case "welcome": return message.capabilities.join();
    case undefined: return message.memory.kind === "host_shm" ? message.memory.name : "elsewhere";
  }
}

export function newest(series: Series): string {
  return series.kind === "scalar" ? series.value.toFixed() : series.kind === "text" ? series.value : "";
}

export const port: 6001 = FRAMING.ipc_port;
export const most: 1048576 = LIMITS.max_payload_bytes;
// @ts-expect-error: a frame has more
export const frame: Frame = { type: "frame" };
// @ts-expect-error: that is no kind of memory
export const memory: HostShmMemory = { kind: "disk", bytes: 1, name: "a" };
export type Memory = InitPacket["memory"];
