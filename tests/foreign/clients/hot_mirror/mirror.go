// A mirror on a wall: shows what a renderer shows, and has no keys.
package main

/*
typedef struct { char bytes[64]; } handle;
int cudaSetDevice(int);
int cudaIpcOpenMemHandle(void **, handle, unsigned);
int cudaIpcCloseMemHandle(void *);
int cudaIpcOpenEventHandle(void **, handle);
int cudaEventDestroy(void *);
int cudaMemcpy(void *, const void *, unsigned long, int);
*/
import "C"

import (
	"encoding/base64"
	"encoding/binary"
	"encoding/json"
	"net"
	"os"
	"runtime"
	"time"
	"unsafe"
)

type packet struct {
	Type *string
	Meta *struct {
		W, H                     int
		FmtColor, FmtDepth       string
		PitchColor, PitchDepth   int
		OffsetColor, OffsetDepth int64
		Device                   int
	}
	MemColor string `json:"mem_color"`
	MemDepth string `json:"mem_depth"`
	EvtDone  string `json:"evt_done"`
}

func handle(text string) (h C.handle, ok bool) {
	raw, err := base64.StdEncoding.DecodeString(text)
	if err != nil || len(raw) != 64 {
		return h, false
	}
	copy((*[64]byte)(unsafe.Pointer(&h))[:], raw)
	return h, true
}

type picture struct {
	colour, depth, done unsafe.Pointer
	pixels, distances   []byte
	colourAt, depthAt   int64
}

func open(payload []byte) *picture {
	var p packet
	if json.Unmarshal(payload, &p) != nil || p.Type != nil || p.Meta == nil {
		return nil
	}
	m := p.Meta
	if m.W < 1 || m.H < 1 || m.W > 32768 || m.H > 32768 || m.FmtColor != "RGBA32F" || m.FmtDepth != "R32F" ||
		m.PitchColor != 16*m.W || m.PitchDepth != 4*m.W || m.OffsetColor < 0 || m.OffsetColor%16 != 0 ||
		m.OffsetDepth < 0 || m.OffsetDepth%4 != 0 || m.Device < 0 {
		return nil
	}
	colour, ok1 := handle(p.MemColor)
	depth, ok2 := handle(p.MemDepth)
	done, ok3 := handle(p.EvtDone)
	made := &picture{colourAt: m.OffsetColor, depthAt: m.OffsetDepth}
	if !ok1 || !ok2 || !ok3 || C.cudaSetDevice(C.int(m.Device)) != 0 {
		return nil
	}
	if C.cudaIpcOpenMemHandle(&made.colour, colour, 1) != 0 || C.cudaIpcOpenMemHandle(&made.depth, depth, 1) != 0 ||
		C.cudaIpcOpenEventHandle(&made.done, done) != 0 {
		made.close()
		return nil
	}
	made.pixels, made.distances = make([]byte, 16*m.W*m.H), make([]byte, 4*m.W*m.H)
	return made
}

func (p *picture) read() {
	C.cudaMemcpy(unsafe.Pointer(&p.pixels[0]), unsafe.Add(p.colour, p.colourAt), C.ulong(len(p.pixels)), 2)
	C.cudaMemcpy(unsafe.Pointer(&p.distances[0]), unsafe.Add(p.depth, p.depthAt), C.ulong(len(p.distances)), 2)
}

func (p *picture) close() {
	for _, memory := range []unsafe.Pointer{p.colour, p.depth} {
		if memory != nil {
			C.cudaIpcCloseMemHandle(memory)
		}
	}
	if p.done != nil {
		C.cudaEventDestroy(p.done)
	}
}

func show(conn net.Conn) {
	greeting := []byte(`{"type":"get_viewport_size"}`)
	header := make([]byte, 4)
	binary.LittleEndian.PutUint32(header, uint32(len(greeting)))
	conn.Write(append(header, greeting...))
	var shown *picture
	for buffer := make([]byte, 65536); ; {
		if shown != nil {
			shown.read()
			conn.SetReadDeadline(time.Now().Add(20 * time.Millisecond))
		}
		count, err := conn.Read(buffer)
		if timeout, is := err.(net.Error); is && timeout.Timeout() {
			continue
		}
		if err != nil {
			break
		}
		if count < 4 {
			continue
		}
		length := int32(binary.LittleEndian.Uint32(buffer))
		if length > 0 && int(length) <= count-4 && shown == nil {
			shown = open(buffer[4 : 4+length])
		}
	}
	if shown != nil {
		shown.close()
	}
}

func main() {
	runtime.LockOSThread() // CUDA keeps its device with the thread
	address := net.JoinHostPort(os.Getenv("SPLATBUS_HOST"), os.Getenv("SPLATBUS_IPC_PORT"))
	for {
		if conn, err := net.Dial("tcp", address); err == nil {
			show(conn)
			conn.Close()
		}
		time.Sleep(3 * time.Millisecond)
	}
}
