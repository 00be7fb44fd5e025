// A slide show of one coloured box: a slow renderer that draws four times a second, come what may.
package main

/*
#include <stddef.h>
typedef struct { char bytes[64]; } handle;
int cudaMalloc(void **, size_t);
int cudaMemcpy(void *, const void *, size_t, int);
int cudaEventCreateWithFlags(void **, unsigned);
int cudaEventRecord(void *, void *);
int cudaEventSynchronize(void *);
int cudaIpcGetMemHandle(handle *, void *);
int cudaIpcGetEventHandle(handle *, void *);
*/
import "C"

import (
	"encoding/base64"
	"encoding/binary"
	"encoding/json"
	"fmt"
	"io"
	"log"
	"math"
	"net"
	"os"
	"runtime"
	"sync"
	"time"
	"unsafe"
)

const (
	width, height = 40, 30
	focal         = 36.0
	between       = 250 * time.Millisecond
	largest       = 1 << 20
	most          = 6
	near, far     = 0.01, 100.0
)

type vector [3]float64
type quaternion [4]float64
type pose struct {
	p vector
	q quaternion
}

var (
	rest    = pose{q: quaternion{3: 1}}
	cameras = []pose{{vector{0, 0, -4}, quaternion{3: 1}}, {vector{1, -0.5, -3}, quaternion{0, 0, 0.6, 0.8}}, {vector{0, -2, -3}, quaternion{-0.28, 0, 0, 0.96}}}
	half    = vector{0.8, 0.5, 0.6}
	paint   = [3][2][3]float32{{{0.9, 0.2, 0.1}, {0.5, 0.1, 0.3}}, {{0.2, 0.8, 0.2}, {0.1, 0.4, 0.4}}, {{0.2, 0.3, 0.9}, {0.9, 0.8, 0.1}}}
)

func (q quaternion) matrix() (m [3]vector) {
	x, y, z, w := q[0], q[1], q[2], q[3]
	s := 2 / (x*x + y*y + z*z + w*w)
	return [3]vector{
		{s / 2 * (w*w + x*x - y*y - z*z), s * (x*y - z*w), s * (x*z + y*w)},
		{s * (x*y + z*w), s / 2 * (w*w - x*x + y*y - z*z), s * (y*z - x*w)},
		{s * (x*z - y*w), s * (y*z + x*w), s / 2 * (w*w - x*x - y*y + z*z)},
	}
}

func turned(m [3]vector, v vector) (out vector) {
	for i := range out {
		out[i] = m[i][0]*v[0] + m[i][1]*v[1] + m[i][2]*v[2]
	}
	return out
}

func back(m [3]vector, v vector) (out vector) {
	for i := range out {
		out[i] = m[0][i]*v[0] + m[1][i]*v[1] + m[2][i]*v[2]
	}
	return out
}

// hit is where a ray enters the box, and by which side.
func hit(from, along vector) (at float64, axis, side int) {
	enter, leave := math.Inf(-1), math.Inf(1)
	for i := range from {
		a, b := (-half[i]-from[i])/along[i], (half[i]-from[i])/along[i]
		first := 0
		if a > b {
			a, b, first = b, a, 1
		}
		if a > enter {
			enter, axis, side = a, i, first
		}
		leave = math.Min(leave, b)
	}
	if !(enter <= leave && enter >= near && enter <= far) {
		return 0, 0, -1
	}
	return enter, axis, side
}

func draw(camera, box pose, color, depth []float32) {
	mc, mb := camera.q.matrix(), box.q.matrix()
	from := camera.p
	for i := range from {
		from[i] -= box.p[i]
	}
	from = back(mb, from)
	for i := 0; i < height; i++ {
		for j := 0; j < width; j++ {
			ray := vector{(float64(j) + 0.5 - width/2) / focal, (float64(i) + 0.5 - height/2) / focal, 1}
			k := (height-1-i)*width + j
			at, axis, side := hit(from, back(mb, turned(mc, ray)))
			copy(color[4*k:4*k+4], []float32{0, 0, 0, 0})
			depth[k] = float32(math.Inf(1))
			if side >= 0 {
				copy(color[4*k:], paint[axis][side][:])
				color[4*k+3], depth[k] = 1, float32(at)
			}
		}
	}
}

type server struct {
	sync.Mutex
	camera, box pose
	holder      net.Conn
	drawn       bool
	init        []byte
}

func must(code C.int) {
	if code != 0 {
		log.Fatal("CUDA says ", code)
	}
}

func (s *server) render() {
	runtime.LockOSThread()
	time.Sleep(between) // the scene is loaded
	var color, depth, done unsafe.Pointer
	must(C.cudaMalloc(&color, 16*width*height))
	must(C.cudaMalloc(&depth, 4*width*height))
	must(C.cudaEventCreateWithFlags(&done, 4|2))
	var handles [3]C.handle
	must(C.cudaIpcGetMemHandle(&handles[0], color))
	must(C.cudaIpcGetMemHandle(&handles[1], depth))
	must(C.cudaIpcGetEventHandle(&handles[2], done))
	packet := object{"meta": object{"w": width, "h": height, "fmtColor": "RGBA32F", "fmtDepth": "R32F", "pitchColor": 16 * width, "pitchDepth": 4 * width}}
	for i, name := range []string{"mem_color", "mem_depth", "evt_done"} {
		packet[name] = base64.StdEncoding.EncodeToString(unsafe.Slice((*byte)(unsafe.Pointer(&handles[i])), 64))
	}
	colors, depths := make([]float32, 4*width*height), make([]float32, width*height)
	for tick := time.NewTicker(between); ; <-tick.C {
		s.Lock()
		camera, box := s.camera, s.box
		s.Unlock()
		draw(camera, box, colors, depths)
		must(C.cudaMemcpy(color, unsafe.Pointer(&colors[0]), 16*width*height, 1))
		must(C.cudaMemcpy(depth, unsafe.Pointer(&depths[0]), 4*width*height, 1))
		must(C.cudaEventRecord(done, nil))
		must(C.cudaEventSynchronize(done))
		s.Lock()
		s.init, _ = json.Marshal(packet)
		s.drawn = true
		s.Unlock()
	}
}

func packet(conn net.Conn) ([]byte, error) {
	conn.SetReadDeadline(time.Time{})
	header := make([]byte, 4)
	if _, err := io.ReadFull(conn, header[:1]); err != nil {
		return nil, err
	}
	conn.SetReadDeadline(time.Now().Add(10 * time.Second))
	if _, err := io.ReadFull(conn, header[1:]); err != nil {
		return nil, err
	}
	length := binary.LittleEndian.Uint32(header)
	if length == 0 || length > largest {
		return nil, fmt.Errorf("a length of %d", length)
	}
	return io.ReadAll(&exact{conn, int(length)})
}

// exact is so many bytes of a stream, and an error if it has fewer.
type exact struct {
	from io.Reader
	left int
}

func (e *exact) Read(into []byte) (int, error) {
	if e.left == 0 {
		return 0, io.EOF
	}
	if len(into) > e.left {
		into = into[:e.left]
	}
	count, err := e.from.Read(into)
	e.left -= count
	if err == io.EOF && e.left > 0 {
		err = io.ErrUnexpectedEOF
	}
	return count, err
}

func send(conn net.Conn, payload []byte) error {
	conn.SetWriteDeadline(time.Now().Add(4 * time.Second))
	_, err := conn.Write(append(binary.LittleEndian.AppendUint32(nil, uint32(len(payload))), payload...))
	return err
}

func (s *server) images(conn net.Conn) {
	ended := make(chan bool)
	go func() {
		defer close(ended)
		for {
			if _, err := packet(conn); err != nil {
				return
			}
		}
	}()
	for told := false; !told; {
		s.Lock()
		init := s.init
		s.Unlock()
		if init != nil {
			send(conn, init)
			break
		}
		select {
		case <-ended:
			return
		case <-time.After(20 * time.Millisecond):
		}
	}
	<-ended
}

func numbers(value any, names string) ([]float64, bool) {
	members, ok := value.(object)
	found := make([]float64, len(names))
	for i := range found {
		number, is := members[names[i:i+1]].(float64)
		found[i], ok = number, ok && is && math.Abs(number) <= math.MaxFloat32
	}
	return found, ok
}

func (s *server) move(conn net.Conn, kind string, message object) {
	p, ok := numbers(message["position"], "xyz")
	q, sure := numbers(message["rotation"], "xyzw")
	if t, is := message["timestamp"]; is {
		if _, is := t.(float64); !is {
			return
		}
	}
	if !ok || !sure || math.Abs(math.Sqrt(q[0]*q[0]+q[1]*q[1]+q[2]*q[2]+q[3]*q[3])-1) > 0.01 {
		return
	}
	s.Lock()
	defer s.Unlock()
	if s.holder == nil {
		s.holder = conn
	}
	if s.holder != conn {
		return
	}
	now := pose{vector{p[0], p[1], p[2]}, quaternion{q[0], q[1], q[2], q[3]}}
	if kind == "camera_pose" {
		s.camera = now
	} else {
		s.box = now
	}
}

func (s *server) answer(message object) any {
	switch message["type"] {
	case "get_viewport_size":
		s.Lock()
		defer s.Unlock()
		if !s.drawn {
			return object{"viewport_size": []int{0, 0}}
		}
		return object{"viewport_size": []int{width, height}}
	case "get_camera_pose":
		index, ok := message["cam_idx"].(float64)
		if !ok || index != math.Trunc(index) || math.Abs(index) > 1<<53-1 {
			return nil
		}
		n := int64(len(cameras))
		it := cameras[(int64(index)%n+n)%n]
		return object{"position": it.p, "rotation": it.q}
	}
	return nil
}

func (s *server) messages(conn net.Conn) {
	defer func() {
		s.Lock()
		if s.holder == conn {
			s.holder = nil
		}
		s.Unlock()
	}()
	for {
		payload, err := packet(conn)
		if err != nil {
			return
		}
		message, err := read(payload)
		if err != nil {
			continue
		}
		if kind, _ := message["type"].(string); kind == "camera_pose" || kind == "point_cloud_pose" {
			s.move(conn, kind, message)
		} else if reply := s.answer(message); reply != nil {
			text, _ := json.Marshal(reply)
			if send(conn, text) != nil {
				return
			}
		}
	}
}

func listen(port, usual string, serve func(net.Conn)) {
	if set := os.Getenv(port); set != "" {
		usual = set
	}
	listener, err := net.Listen("tcp", "127.0.0.1:"+usual)
	if err != nil {
		log.Fatal(err)
	}
	places := make(chan bool, most)
	for {
		conn, err := listener.Accept()
		if err != nil {
			log.Fatal(err)
		}
		select {
		case places <- true:
			go func() {
				serve(conn)
				conn.Close()
				<-places
			}()
		default:
			conn.Close()
		}
	}
}

func main() {
	s := &server{camera: cameras[0], box: rest}
	go s.render()
	go listen("SPLATBUS_IPC_PORT", "6001", s.images)
	listen("SPLATBUS_MSG_PORT", "6000", s.messages)
}
