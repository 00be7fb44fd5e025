// A viewer of SplatBus 1.1 without a window: images in memory of the host, and a camera.
package main

import (
	"bytes"
	"encoding/binary"
	"encoding/json"
	"fmt"
	"io"
	"math"
	"net"
	"os"
	"regexp"
	"sort"
	"strconv"
	"syscall"
	"time"
	"unicode/utf8"
)

type object = map[string]interface{}

const safe = 1<<53 - 1

var start = time.Now()
var pairs = regexp.MustCompile(`(?i)\\\\|\\ud[89ab]..\\ud[c-f]..|\\ud[89a-f]..`)
var versions = regexp.MustCompile(`^1\.[1-9][0-9]*$`)
var names = regexp.MustCompile(`^[A-Za-z0-9_-][A-Za-z0-9._-]{0,29}$`)

type bad string // what a message is, if it is not what it should be

func need(fact bool, why string) {
	if !fact {
		panic(bad(why))
	}
}

func attempt(do func()) (why string) { // "" if all was well
	defer func() {
		switch text := recover().(type) {
		case nil:
		case bad:
			why = string(text)
		default:
			panic(text)
		}
	}()
	do()
	return ""
}

// ---- text ----

func value(from *json.Decoder, depth int) interface{} {
	token, err := from.Token()
	need(err == nil, "no JSON")
	if number, is := token.(json.Number); is {
		read, err := strconv.ParseFloat(string(number), 64)
		need(err == nil, "no finite number")
		return read
	}
	open, is := token.(json.Delim)
	if !is {
		return token
	}
	need(depth <= 64, "too deep")
	var items []interface{}
	members := object{}
	for from.More() {
		if open == '[' {
			items = append(items, value(from, depth+1))
			continue
		}
		name, _ := from.Token()
		_, twice := members[name.(string)]
		need(!twice, "a name twice")
		members[name.(string)] = value(from, depth+1)
	}
	from.Token()
	if open == '[' {
		return items
	}
	return members
}

func parse(payload []byte) (message object) {
	why := attempt(func() {
		need(utf8.Valid(payload) && json.Valid(payload), "no JSON")
		for _, found := range pairs.FindAll(payload, -1) {
			need(len(found) != 6, "half a surrogate pair")
		}
		decoder := json.NewDecoder(bytes.NewReader(payload))
		decoder.UseNumber()
		message, _ = value(decoder, 1).(object)
	})
	if why != "" {
		return nil
	}
	return message
}

func whole(of object, name string, least, most, unit float64) int64 {
	n, is := of[name].(float64)
	need(is && n >= least && n <= most && math.Mod(n, unit) == 0, name+" is not what it may be")
	return int64(n)
}

func one(of object, name string, among ...string) bool {
	for _, each := range among {
		if of[name] == each {
			return true
		}
	}
	return false
}

// ---- a connection ----

type link struct {
	conn    net.Conn
	granted map[string]bool
	version string // "" until it is known
	blamed  bool   // there was an error
}

func (l *link) say(message object) {
	payload, _ := json.Marshal(message)
	packet := make([]byte, 4, 4+len(payload))
	binary.LittleEndian.PutUint32(packet, uint32(len(payload)))
	_, err := l.conn.Write(append(packet, payload...))
	need(err == nil, "lost")
}

func (l *link) hello(capabilities ...string) {
	l.say(object{"type": "hello", "versions": []string{"1.1", "1.0"}, "capabilities": capabilities,
		"client": object{"name": "go mirror", "version": "1"}})
}

func (l *link) packet() []byte {
	header := make([]byte, 4)
	l.conn.SetReadDeadline(time.Time{})
	_, err := io.ReadFull(l.conn, header[:1])
	need(err == nil, "lost")
	l.conn.SetReadDeadline(time.Now().Add(10 * time.Second))
	_, err = io.ReadFull(l.conn, header[1:])
	length := binary.LittleEndian.Uint32(header)
	need(err == nil && length >= 1 && length <= 1<<20, "no packet")
	var payload bytes.Buffer
	_, err = io.CopyN(&payload, l.conn, int64(length))
	need(err == nil, "half a packet")
	return payload.Bytes()
}

func (l *link) welcomed(message object) {
	if l.version != "" {
		return
	}
	listed, is := message["capabilities"].([]interface{})
	need(is && one(message, "version", "1.1", "1.0"), "no welcome")
	for _, each := range listed {
		name, _ := each.(string)
		l.granted[name] = true
	}
	l.version = message["version"].(string)
}

// ---- images ----

type ring struct {
	memory                                       []byte
	slots, w, h, size                            int64
	colourAt, colourStride, depthAt, depthStride int64
	brightest                                    float32
}

// The ring of an init packet, mapped; panics where it may not be.
func opened(packet object) *ring {
	meta, _ := packet["meta"].(object)
	memory, _ := packet["memory"].(object)
	laid, _ := packet["ring"].(object)
	means, _ := packet["semantics"].(object)
	depth, _ := means["depth"].(object)
	version, _ := packet["version"].(string)
	need(versions.MatchString(version), "another version")
	need(one(meta, "fmtColor", "RGBA32F") && one(meta, "fmtDepth", "R32F"), "another format")
	need(one(means, "rows", "bottom_up") && one(means, "alpha", "straight", "premultiplied") &&
		one(means, "colorSpace", "srgb", "linear") && one(depth, "kind", "planar_z", "ray_distance") &&
		one(depth, "estimator", "harmonic", "expected", "median"), "unknown semantics")
	empty, number := depth["empty"].(float64)
	need(number && !math.IsInf(float64(float32(empty)), 0) || depth["empty"] == "inf", "no depth of what is empty")
	metres, there := means["unitMetres"]
	length, number := metres.(float64)
	need(there && (metres == nil || number && length > 0), "no unit")
	origin, _ := means["origin"].([]interface{})
	need(len(origin) == 3, "no origin")
	for _, each := range origin {
		_, number := each.(float64)
		need(number, "no origin")
	}
	for name, unit := range map[string]float64{"offsetColor": 16, "offsetDepth": 4, "device": 1} {
		if _, there := meta[name]; there {
			whole(meta, name, 0, safe, unit)
		}
	}
	r := &ring{w: whole(meta, "w", 1, 32768, 1), h: whole(meta, "h", 1, 32768, 1)}
	w, image := float64(r.w), float64(r.w*r.h)
	whole(meta, "pitchColor", 16*w, 16*w, 1)
	whole(meta, "pitchDepth", 4*w, 4*w, 1)
	r.size, r.slots = whole(memory, "bytes", 1, safe, 1), whole(laid, "slots", 1, 1024, 1)
	r.colourAt, r.depthAt = whole(laid, "colorOffset", 0, safe, 16), whole(laid, "depthOffset", 0, safe, 16)
	r.colourStride = whole(laid, "colorStride", 16*image, safe, 16)
	r.depthStride = whole(laid, "depthStride", 4*image, safe, 16)
	span := func(at, stride int64, image float64) float64 { // a float64 cannot overflow here
		return float64(at) + float64(r.slots-1)*float64(stride) + image
	}
	need(span(r.colourAt, r.colourStride, 16*image) <= float64(r.size) &&
		span(r.depthAt, r.depthStride, 4*image) <= float64(r.size), "the ring is larger than its memory (MEM-10)")
	var planes [][2]int64
	for slot := int64(0); slot < r.slots; slot++ {
		planes = append(planes, [2]int64{r.colourAt + slot*r.colourStride, 16 * r.w * r.h},
			[2]int64{r.depthAt + slot*r.depthStride, 4 * r.w * r.h})
	}
	sort.Slice(planes, func(i, j int) bool { return planes[i][0] < planes[j][0] })
	for i := range planes[1:] {
		need(planes[i][0]+planes[i][1] <= planes[i+1][0], "planes overlap (MEM-9)")
	}
	name, _ := memory["name"].(string)
	need(one(memory, "kind", "host_shm") && names.MatchString(name), "no memory of the host")
	file, err := os.Open("/dev/shm/" + name)
	need(err == nil, "cannot open "+name)
	defer file.Close()
	about, err := file.Stat()
	need(err == nil && about.Size() >= r.size, "memory is shorter than announced (MEM-6)")
	r.memory, err = syscall.Mmap(int(file.Fd()), 0, int(r.size), syscall.PROT_READ, syscall.MAP_SHARED)
	need(err == nil, "cannot map "+name)
	return r
}

func (r *ring) look(slot int64) {
	at := r.colourAt + slot*r.colourStride
	for end := at + 16*r.w*r.h; at < end; at += 4 {
		if v := math.Float32frombits(binary.LittleEndian.Uint32(r.memory[at:])); v > r.brightest {
			r.brightest = v
		}
	}
}

type images struct {
	*link
	shown   *ring
	newest  int64  // generation
	waiting object // an init packet that came before welcome
}

func (v *images) open(packet object) {
	var generation int64
	why := attempt(func() { generation = whole(packet, "generation", 1, safe, 1) })
	if why != "" || generation <= v.newest || (v.newest > 0 && !v.granted["reinit"]) {
		return
	}
	var next *ring
	if why = attempt(func() { next = opened(packet) }); why == "" {
		v.say(object{"type": "opened", "generation": generation})
	} else {
		v.say(object{"type": "open_failed", "generation": generation, "reason": why})
	}
	if v.shown != nil {
		syscall.Munmap(v.shown.memory)
		v.say(object{"type": "closed", "generation": v.newest})
	}
	v.shown, v.newest = next, generation
}

func (v *images) frame(message object) {
	if v.shown == nil || !v.granted["frames"] || message["generation"] != float64(v.newest) {
		return
	}
	var slot, seq int64
	if attempt(func() {
		slot, seq = whole(message, "slot", 0, float64(v.shown.slots-1), 1), whole(message, "seq", 0, safe, 1)
	}) == "" {
		v.shown.look(slot)
		v.say(object{"type": "release", "generation": v.newest, "seq": seq})
	}
}

func (v *images) take(message object) {
	_, typed := message["type"]
	_, meta := message["meta"]
	_, later := message["version"]
	switch {
	case one(message, "type", "welcome"):
		v.welcomed(message)
		if v.version == "1.1" && v.waiting != nil {
			v.open(v.waiting)
			v.waiting = nil
		}
	case one(message, "type", "error"):
		v.blamed = true
	case one(message, "type", "frame"):
		v.frame(message)
	case typed || !meta:
	case !later && v.version == "":
		v.version = "1.0"
	case v.version == "" && v.waiting == nil:
		v.waiting = message
	case v.version == "1.1":
		v.open(message)
	}
}

func watch(l *link) {
	v := &images{link: l}
	attempt(func() {
		for l.hello("host_shm", "frames", "reinit"); ; {
			v.take(parse(l.packet()))
		}
	})
	if v.shown != nil {
		syscall.Munmap(v.shown.memory)
	}
}

// ---- the camera ----

type turned struct{ Y, W float64 }

func (q turned) MarshalJSON() ([]byte, error) { // a map's members come by name, with w first
	return []byte(fmt.Sprintf(`{"x":0,"y":%g,"z":0,"w":%g}`, q.Y, q.W)), nil
}

func (l *link) look(turn float64) {
	made := object{"type": "camera_pose", "timestamp": time.Since(start).Seconds(),
		"position": object{"x": math.Sin(turn), "y": 0.25, "z": -4.5},
		"rotation": turned{math.Sin(turn / 8), math.Cos(turn / 8)}}
	if l.granted["intrinsics"] {
		made["intrinsics"] = object{"fx": 60, "fy": 60, "cx": 32, "cy": 24, "width": 64, "height": 48, "near": 0.01, "far": 100}
	}
	l.say(made)
}

func steer(l *link) {
	l.hello("intrinsics")
	l.say(object{"type": "get_viewport_size"})
	known := make(chan bool, 1)
	go attempt(func() {
		select {
		case <-known:
		case <-time.After(9 * time.Second):
			l.conn.Close()
		}
		for turn := 0.0; ; turn += 0.02 {
			l.look(turn)
			time.Sleep(40 * time.Millisecond)
		}
	})
	for asked := true; ; {
		message := parse(l.packet())
		need(message != nil || !asked, "this may have been the reply")
		answered := asked && message["viewport_size"] != nil
		switch {
		case one(message, "type", "welcome"):
			l.welcomed(message)
		case one(message, "type", "error"):
			l.blamed = true
			answered = asked && l.version == "1.1" && !one(message, "code", "busy")
		case answered && l.version == "":
			l.version = "1.0"
		}
		if answered {
			asked = false
			known <- true
		}
	}
}

func forever(variable, usual string, talk func(*link)) {
	where := []string{os.Getenv("SPLATBUS_HOST"), os.Getenv(variable)}
	for i, otherwise := range []string{"127.0.0.1", usual} {
		if where[i] == "" {
			where[i] = otherwise
		}
	}
	for pause := 120 * time.Millisecond; ; {
		begun := time.Now()
		conn, err := net.DialTimeout("tcp", net.JoinHostPort(where[0], where[1]), 3*time.Second)
		if err == nil { // and Go has set TCP_NODELAY
			l := &link{conn: conn, granted: map[string]bool{}}
			attempt(func() { talk(l) })
			conn.Close()
			pause = 120 * time.Millisecond
			if l.blamed {
				time.Sleep(time.Second)
			}
		} else if pause *= 2; pause > 3*time.Second {
			pause = 3 * time.Second
		}
		time.Sleep(time.Until(begun.Add(pause)))
	}
}

func main() {
	go forever("SPLATBUS_IPC_PORT", "6001", watch)
	forever("SPLATBUS_MSG_PORT", "6000", steer)
}
