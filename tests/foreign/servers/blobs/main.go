// A server of SplatBus 1.1 that draws a few soft blobs into shared memory of the host.
package main

import (
	"bufio"
	"encoding/binary"
	"encoding/json"
	"fmt"
	"io"
	"net"
	"os"
	"os/signal"
	"path/filepath"
	"strings"
	"sync"
	"syscall"
	"time"
)

const (
	kept, readersKept = 8, 4
	largest           = 1 << 20
	safe              = 1<<53 - 1
)

var (
	mu      sync.Mutex // guards all that follows, and the clients
	changed = sync.NewCond(&mu)
	clients = map[*client]bool{}
	control []*client // those that posed, the first has control
	camera  = tagged{pose: rest}
	cloud   = rest
	due     = true
	newest  *image
	memory  []byte
	shared  string
	started = time.Now()
	nextID  int64
	cameras = []pose{{[3]float64{0, 0, -1}, rest.q}, {[3]float64{1, -0.5, 0}, [4]float64{0, -0.28, 0, 0.96}}}
	has     = map[string]bool{"host_shm": true, "frames": true}
	known   = map[string]bool{"get_scene": true, "ping": true, "set_viewport": true, "object_pose": true, "set_time": true, "subscribe_telemetry": true}
)

type tagged struct {
	pose
	tag string
	id  int64
}

type image struct {
	seq    int64
	slot   int
	camera tagged
	cloud  pose
	at     float64
}

type client struct {
	conn              net.Conn
	ipc, hello, newer bool
	ending            bool // an error was sent after which the connection ends
	granted           map[string]bool
	out               []byte
	closing           bool
	wake, done        chan bool

	opened   bool
	lent     *image // what it holds
	seen     int64  // the last seq that it was sent
	shownID  int64  // the last camera that it was shown
	reader   bool
	toldBusy bool
	camera   *tagged // the newest that it sent
	cloud    *pose
}

func clock() float64 { return time.Since(started).Seconds() }

func (c *client) say(message object) {
	payload, _ := json.Marshal(message)
	c.out = binary.LittleEndian.AppendUint32(c.out, uint32(len(payload)))
	c.out = append(c.out, payload...)
	if len(c.out) > largest {
		c.conn.Close()
	}
	select {
	case c.wake <- true:
	default:
	}
}

func (c *client) write() {
	for {
		mu.Lock()
		out, last := c.out, c.closing
		c.out = nil
		mu.Unlock()
		for len(out) > 0 {
			part := out[:min(len(out), 1<<16)]
			c.conn.SetWriteDeadline(time.Now().Add(5 * time.Second))
			if _, err := c.conn.Write(part); err != nil {
				c.conn.Close()
				break
			}
			out = out[len(part):]
		}
		if last {
			close(c.done)
			return
		}
		<-c.wake
	}
}

func min(a, b int) int {
	if a < b {
		return a
	}
	return b
}

func (c *client) fail(code, pointer string, message object) {
	if !c.newer {
		return
	}
	said := object{"type": "error", "code": code, "message": "cannot be done: " + code}
	if pointer != "" {
		said["pointer"] = pointer
	}
	if id, is := integer(message["id"], 0, safe); is && message["type"] != "camera_pose" && message["type"] != "point_cloud_pose" {
		said["id"] = id
	}
	c.say(said)
}

func (c *client) reply(kind string, message, reply object) {
	if c.newer {
		reply["type"] = kind
		if id, has := message["id"]; has {
			reply["id"], _ = integer(id, 0, safe)
		}
	}
	c.say(reply)
}

func (c *client) greet(message object) {
	if c.hello {
		c.fail("invalid_message", "/type", object{})
		return
	}
	c.hello, c.newer = true, true
	if pointer := breach(message); pointer != "" {
		c.fail("invalid_message", pointer, object{})
		c.ending = true
		return
	}
	version := ""
	for _, each := range message["versions"].([]any) {
		if version == "" && (each == "1.1" || each == "1.0") {
			version = each.(string)
		}
	}
	if version == "" {
		c.say(object{"type": "error", "code": "unsupported_version", "message": "1.1 and 1.0 are spoken here", "supported": []string{"1.1", "1.0"}})
		c.ending = true
		return
	}
	granted := []string{}
	for _, each := range message["capabilities"].([]any) {
		if name := each.(string); version == "1.1" && c.ipc && has[name] {
			granted = append(granted, name)
			c.granted[name] = true
		}
	}
	c.say(object{"type": "welcome", "version": version, "server": object{"name": "blobs", "version": "1"}, "capabilities": granted})
	c.newer = version == "1.1"
	if c.granted["frames"] {
		readers := 0
		for each := range clients {
			if each.reader {
				readers++
			}
		}
		if readers >= readersKept {
			c.fail("too_many_clients", "", object{})
			c.ending = true
			return
		}
		c.reader = true
	}
	if c.granted["host_shm"] {
		c.say(object{"version": "1.1", "generation": 1,
			"meta":      object{"w": width, "h": height, "fmtColor": "RGBA32F", "pitchColor": 16 * width, "fmtDepth": "R32F", "pitchDepth": 4 * width},
			"memory":    object{"kind": "host_shm", "name": shared, "bytes": len(memory)},
			"ring":      object{"slots": slots, "colorOffset": 0, "colorStride": colorBytes, "depthOffset": slots * colorBytes, "depthStride": depthBytes},
			"semantics": object{"rows": "bottom_up", "alpha": "straight", "colorSpace": "srgb", "depth": object{"kind": "planar_z", "estimator": "expected", "empty": "inf"}, "unitMetres": nil, "origin": []float64{0, 0, 0}}})
	}
}

func (c *client) handle(payload []byte) {
	message, code := read(payload)
	if code != "" {
		c.fail(code, "", object{})
		return
	}
	kind, _ := message["type"].(string)
	if kind == "hello" {
		c.greet(message)
	} else if c.ipc {
		c.image(kind, message)
	} else {
		c.steer(kind, message)
	}
}

func (c *client) image(kind string, message object) {
	generation, right := integer(message["generation"], 1, safe)
	seq, numbered := integer(message["seq"], 0, safe)
	switch kind {
	case "opened", "open_failed", "closed", "release":
		if !right || (kind == "release" && !numbered) || (kind == "open_failed" && !text(message["reason"], 1, 1024)) {
			c.fail("invalid_message", "/generation", object{})
		} else if generation != 1 || !c.granted["host_shm"] {
			return
		} else if kind == "release" {
			if c.lent != nil && c.lent.seq == seq {
				c.lent = nil
			}
		} else if c.opened = kind == "opened" && c.granted["frames"]; !c.opened {
			c.lent = nil
		}
		lend(c)
		changed.Signal()
	case "subscribe":
		c.fail("unsupported", "", object{})
	default:
		c.fail("unknown_type", "/type", object{})
	}
}

func lend(c *client) {
	if !c.opened || c.lent != nil || newest == nil || newest.seq <= c.seen {
		return
	}
	it := newest
	shown := object{"position": it.camera.p, "rotation": it.camera.q, "fx": focal, "fy": focal, "cx": width / 2, "cy": height / 2,
		"width": width, "height": height, "near": near, "far": far}
	if it.camera.id != c.shownID && it.camera.tag != "" {
		shown["tag"] = it.camera.tag
	}
	frame := object{"type": "frame", "generation": 1, "seq": it.seq, "slot": it.slot, "camera": shown, "time": 0, "renderedAt": it.at}
	if it.cloud != rest {
		frame["objects"] = []object{{"object": "default", "position": it.cloud.p, "rotation": it.cloud.q, "scale": 1}}
	}
	c.lent, c.seen, c.shownID = it, it.seq, it.camera.id
	c.say(frame)
}

func (c *client) steer(kind string, message object) {
	if id, is := message["id"]; is && c.newer && (strings.HasPrefix(kind, "get_") || kind == "ping" || kind == "set_viewport") {
		if _, right := integer(id, 0, safe); !right {
			c.fail("invalid_message", "/id", object{})
			return
		}
	}
	if known[kind] {
		c.fail("unsupported", "", message)
		return
	}
	switch kind {
	case "camera_pose", "point_cloud_pose":
		c.pose(kind, message)
	case "get_viewport_size":
		c.reply("viewport_size", message, object{"viewport_size": []int{width, height}})
	case "get_camera_pose":
		index, right := integer(message["cam_idx"], -safe, safe)
		if !right {
			c.fail("invalid_message", "/cam_idx", message)
			return
		}
		count := int64(len(cameras))
		it := cameras[(index%count+count)%count]
		c.reply("camera", message, object{"position": it.p, "rotation": it.q})
	default:
		c.fail("unknown_type", "/type", object{})
	}
}

func (c *client) pose(kind string, message object) {
	it, bad := poseOf(message)
	tag, hasTag := message["tag"]
	if bad == nil && kind == "camera_pose" && c.newer && hasTag && !text(tag, 1, 64) {
		bad = invalid("/tag")
	}
	if bad != nil {
		c.fail(bad.code, bad.pointer, object{})
		return
	}
	if c.camera == nil && c.cloud == nil {
		control = append(control, c)
	}
	if kind == "point_cloud_pose" {
		c.cloud = &it
	} else {
		c.camera = &tagged{pose: it}
		if c.newer && hasTag {
			c.camera.tag = tag.(string)
		}
	}
	if control[0] == c {
		c.apply(kind == "camera_pose", kind == "point_cloud_pose")
	} else if !c.toldBusy {
		c.toldBusy = true
		c.fail("busy", "", object{})
	}
}

func (c *client) apply(withCamera, withCloud bool) {
	c.toldBusy = false
	before := [...]pose{camera.pose, cloud}
	if withCamera && c.camera != nil {
		nextID++
		camera = tagged{c.camera.pose, c.camera.tag, nextID}
	}
	if withCloud && c.cloud != nil {
		cloud = *c.cloud
	}
	if before != [...]pose{camera.pose, cloud} {
		due = true
		changed.Signal()
	}
}

func (c *client) leave() {
	delete(clients, c)
	c.opened, c.lent = false, nil
	for i, each := range control {
		if each != c {
			continue
		}
		control = append(control[:i:i], control[i+1:]...)
		if i == 0 && len(control) > 0 {
			control[0].apply(true, true)
		}
		return
	}
}

func (c *client) serve() {
	go c.write()
	from := bufio.NewReaderSize(c.conn, 1<<16)
	for !c.ending {
		if _, err := from.Peek(1); err != nil {
			break
		}
		c.conn.SetReadDeadline(time.Now().Add(10 * time.Second))
		header := make([]byte, 4)
		if _, err := io.ReadFull(from, header); err != nil {
			break
		}
		length := binary.LittleEndian.Uint32(header)
		if length < 1 || length > largest {
			mu.Lock()
			c.fail(map[bool]string{true: "malformed_packet", false: "packet_too_large"}[length < 1], "", object{})
			c.ending = true
			mu.Unlock()
			break
		}
		payload := make([]byte, length)
		if _, err := io.ReadFull(from, payload); err != nil {
			break
		}
		c.conn.SetReadDeadline(time.Time{})
		mu.Lock()
		c.handle(payload)
		mu.Unlock()
	}
	mu.Lock()
	c.leave()
	c.closing = true
	mu.Unlock()
	select {
	case c.wake <- true:
	default:
	}
	<-c.done
	if c.ending {
		c.conn.(*net.TCPConn).CloseWrite()
		c.conn.SetReadDeadline(time.Now().Add(5 * time.Second))
		io.Copy(io.Discard, from)
	}
	c.conn.Close()
}

func render() {
	mu.Lock()
	for seq := int64(0); ; seq++ {
		for !due || !wanted() {
			changed.Wait()
		}
		due = false
		it := &image{seq: seq, slot: free(), camera: camera, cloud: cloud}
		mu.Unlock()
		depth := memory[slots*colorBytes:]
		draw(it.camera.pose, it.cloud, memory[it.slot*colorBytes:], depth[it.slot*depthBytes:])
		mu.Lock()
		it.at = clock()
		newest = it
		for each := range clients {
			lend(each)
		}
	}
}

func wanted() bool {
	for each := range clients {
		if each.opened {
			return true
		}
	}
	return false
}

func free() int {
	taken := [slots]bool{}
	if newest != nil {
		taken[newest.slot] = true
	}
	for each := range clients {
		if each.lent != nil {
			taken[each.lent.slot] = true
		}
	}
	for slot := range taken {
		if !taken[slot] {
			return slot
		}
	}
	panic("each reader holds one slot")
}

func share() {
	left, _ := filepath.Glob("/dev/shm/splatbus-blobs-*")
	for _, path := range left { // what a server left that was killed is locked by nobody
		if file, err := os.Open(path); err == nil {
			if syscall.Flock(int(file.Fd()), syscall.LOCK_EX|syscall.LOCK_NB) == nil {
				os.Remove(path)
			}
			file.Close()
		}
	}
	shared = fmt.Sprintf("splatbus-blobs-%d", os.Getpid())
	file, err := os.OpenFile("/dev/shm/"+shared, os.O_RDWR|os.O_CREATE|os.O_EXCL, 0o600)
	if err != nil {
		panic(err)
	}
	syscall.Flock(int(file.Fd()), syscall.LOCK_EX)
	size := slots * (colorBytes + depthBytes)
	if err = syscall.Fallocate(int(file.Fd()), 0, 0, int64(size)); err == nil {
		memory, err = syscall.Mmap(int(file.Fd()), 0, size, syscall.PROT_READ|syscall.PROT_WRITE, syscall.MAP_SHARED)
	}
	if err != nil {
		panic(err)
	}
	locked = file
}

var locked *os.File // kept, since closing it would end the lock

func listen(variable, otherwise string, ipc bool) {
	port, host := os.Getenv(variable), os.Getenv("SPLATBUS_HOST")
	if port == "" {
		port = otherwise
	}
	if host == "" {
		host = "127.0.0.1"
	}
	if at := net.ParseIP(host); at == nil || !at.IsLoopback() {
		fmt.Fprintln(os.Stderr, "there is no token here, so only loopback addresses are listened on")
		os.Exit(2)
	}
	listener, err := net.Listen("tcp", net.JoinHostPort(host, port))
	if err != nil {
		panic(err)
	}
	for {
		conn, err := listener.Accept()
		if err != nil {
			continue
		}
		c := &client{conn: conn, ipc: ipc, granted: map[string]bool{}, wake: make(chan bool, 1), done: make(chan bool), seen: -1, shownID: -1}
		mu.Lock()
		count := 0
		for each := range clients {
			if each.ipc == ipc {
				count++
			}
		}
		if count < kept {
			clients[c] = true
			go c.serve()
		} else {
			conn.Close()
		}
		mu.Unlock()
	}
}

func main() {
	share()
	go render()
	go listen("SPLATBUS_IPC_PORT", "6001", true)
	go listen("SPLATBUS_MSG_PORT", "6000", false)
	asked := make(chan os.Signal, 1)
	signal.Notify(asked, syscall.SIGTERM, syscall.SIGINT)
	<-asked
	mu.Lock()
	os.Remove("/dev/shm/" + shared)
}
