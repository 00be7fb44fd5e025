// A viewer of SplatBus 1.1 without a window: images in memory of the host, and a camera.
package main

import (
	"bytes"
	"encoding/binary"
	"encoding/json"
	"errors"
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

var errNonsense = errors.New("nonsense")
var start = time.Now()

// ---- text ----

var pairs = regexp.MustCompile(`(?i)\\\\|\\ud[89ab]..\\ud[c-f]..|\\ud[89a-f]..`)

func halves(text []byte) bool { // of surrogate pairs: an escape without its fellow
	for _, found := range pairs.FindAll(text, -1) {
		if len(found) == 6 {
			return true
		}
	}
	return false
}

func value(from *json.Decoder, depth int) (interface{}, error) {
	token, err := from.Token()
	if err != nil {
		return nil, err
	}
	switch t := token.(type) {
	case json.Number:
		return strconv.ParseFloat(string(t), 64)
	case json.Delim:
		if depth > 64 {
			return nil, errNonsense
		}
		var items []interface{}
		members := object{}
		for from.More() {
			if t == '[' {
				item, err := value(from, depth+1)
				if err != nil {
					return nil, err
				}
				items = append(items, item)
				continue
			}
			name, err := from.Token()
			if err != nil {
				return nil, err
			}
			if _, twice := members[name.(string)]; twice {
				return nil, errNonsense
			}
			if members[name.(string)], err = value(from, depth+1); err != nil {
				return nil, err
			}
		}
		if _, err := from.Token(); err != nil {
			return nil, err
		}
		if t == '[' {
			return items, nil
		}
		return members, nil
	}
	return token, nil
}

func parse(payload []byte) (object, error) {
	if !utf8.Valid(payload) || !json.Valid(payload) || halves(payload) {
		return nil, errNonsense
	}
	decoder := json.NewDecoder(bytes.NewReader(payload))
	decoder.UseNumber()
	read, err := value(decoder, 1)
	if members, ok := read.(object); ok && err == nil {
		return members, nil
	}
	return nil, errNonsense
}

func whole(of object, name string, least, most float64) (int64, bool) {
	n, ok := of[name].(float64)
	return int64(n), ok && n == math.Trunc(n) && n >= least && n <= most
}

func real(of object, name string) (float64, bool) {
	n, ok := of[name].(float64)
	return n, ok
}

func one(of object, name string, among ...string) bool {
	for _, each := range among {
		if of[name] == each {
			return true
		}
	}
	return false
}

func texts(value interface{}) (map[string]bool, bool) {
	items, ok := value.([]interface{})
	set := map[string]bool{}
	for _, item := range items {
		text, isText := item.(string)
		ok = ok && isText
		set[text] = true
	}
	return set, ok
}

// ---- a connection ----

type link struct {
	conn    net.Conn
	granted map[string]bool
	version string // "" until it is known
	blamed  bool   // there was an error
}

func dial(variable, usual string) (*link, error) {
	host, port := os.Getenv("SPLATBUS_HOST"), os.Getenv(variable)
	if host == "" {
		host = "127.0.0.1"
	}
	if port == "" {
		port = usual
	}
	conn, err := net.DialTimeout("tcp", net.JoinHostPort(host, port), 3*time.Second)
	return &link{conn: conn, granted: map[string]bool{}}, err // Go sets TCP_NODELAY by itself
}

func (l *link) say(message object) error {
	payload, err := json.Marshal(message)
	if err != nil {
		return err
	}
	packet := make([]byte, 4, 4+len(payload))
	binary.LittleEndian.PutUint32(packet, uint32(len(payload)))
	_, err = l.conn.Write(append(packet, payload...))
	return err
}

func (l *link) hello(capabilities ...string) error {
	return l.say(object{"type": "hello", "versions": []string{"1.1", "1.0"}, "capabilities": capabilities,
		"client": object{"name": "go mirror", "version": "1"}})
}

func (l *link) packet() ([]byte, error) {
	header := make([]byte, 4)
	l.conn.SetReadDeadline(time.Time{})
	if _, err := io.ReadFull(l.conn, header[:1]); err != nil {
		return nil, err
	}
	l.conn.SetReadDeadline(time.Now().Add(10 * time.Second))
	if _, err := io.ReadFull(l.conn, header[1:]); err != nil {
		return nil, err
	}
	length := binary.LittleEndian.Uint32(header)
	if length < 1 || length > 1<<20 {
		return nil, fmt.Errorf("a length of %d", length)
	}
	var payload bytes.Buffer
	_, err := io.CopyN(&payload, l.conn, int64(length))
	return payload.Bytes(), err
}

// Takes a welcome; an error ends the connection.
func (l *link) welcomed(message object) error {
	if l.version != "" {
		return nil
	}
	granted, ok := texts(message["capabilities"])
	if !ok || !one(message, "version", "1.1", "1.0") {
		return errNonsense
	}
	l.version, l.granted = message["version"].(string), granted
	return nil
}

// ---- images ----

type ring struct {
	generation                                         float64
	memory                                             []byte
	slots, w, h                                        int64
	colourAt, colourStride, depthAt, depthStride, need int64
	name                                               string
	brightest                                          float32
}

var names = regexp.MustCompile(`^[A-Za-z0-9_-][A-Za-z0-9._-]{0,29}$`)

const safe = 1<<53 - 1

func checked(packet object) (*ring, error) {
	meta, _ := packet["meta"].(object)
	memory, _ := packet["memory"].(object)
	laid, _ := packet["ring"].(object)
	means, _ := packet["semantics"].(object)
	depth, _ := means["depth"].(object)
	r := &ring{}
	good := one(packet, "version", "1.1") && one(meta, "fmtColor", "RGBA32F") && one(meta, "fmtDepth", "R32F") &&
		one(means, "rows", "bottom_up") && one(means, "alpha", "straight", "premultiplied") &&
		one(means, "colorSpace", "srgb", "linear") && one(depth, "kind", "planar_z", "ray_distance") &&
		one(depth, "estimator", "harmonic", "expected", "median")
	want := func(of object, name string, least, most, unit float64) int64 {
		n, ok := whole(of, name, least, most)
		good = good && ok && math.Mod(float64(n), unit) == 0
		return n
	}
	if _, there := meta["offsetColor"]; there {
		want(meta, "offsetColor", 0, safe, 16)
	}
	if _, there := meta["offsetDepth"]; there {
		want(meta, "offsetDepth", 0, safe, 4)
	}
	if _, there := meta["device"]; there {
		want(meta, "device", 0, safe, 1)
	}
	r.w, r.h = want(meta, "w", 1, 32768, 1), want(meta, "h", 1, 32768, 1)
	w, h := float64(r.w), float64(r.h)
	want(meta, "pitchColor", 16*w, 16*w, 1)
	want(meta, "pitchDepth", 4*w, 4*w, 1)
	size := want(memory, "bytes", 1, safe, 1)
	r.slots = want(laid, "slots", 1, 1024, 1)
	r.colourAt, r.depthAt = want(laid, "colorOffset", 0, safe, 16), want(laid, "depthOffset", 0, safe, 16)
	r.colourStride, r.depthStride = want(laid, "colorStride", 16*w*h, safe, 16), want(laid, "depthStride", 4*w*h, safe, 16)
	if _, empty := real(depth, "empty"); !empty && depth["empty"] != "inf" {
		good = false
	}
	if metres, is := real(means, "unitMetres"); (!is && means["unitMetres"] != nil) || (is && metres <= 0) {
		good = false
	}
	if _, there := means["unitMetres"]; !there {
		good = false
	}
	origin, _ := means["origin"].([]interface{})
	for _, each := range origin {
		_, is := each.(float64)
		good = good && is
	}
	r.name, _ = memory["name"].(string)
	if !good || len(origin) != 3 {
		return nil, errNonsense
	}
	if !one(memory, "kind", "host_shm") || !names.MatchString(r.name) {
		return nil, errors.New("no memory of the host")
	}
	span := func(at, stride, image int64) float64 { // a float64 cannot overflow here
		return float64(at) + float64(r.slots-1)*float64(stride) + float64(image)
	}
	if span(r.colourAt, r.colourStride, 16*r.w*r.h) > float64(size) || span(r.depthAt, r.depthStride, 4*r.w*r.h) > float64(size) {
		return nil, errors.New("the ring is larger than its memory (MEM-10)")
	}
	var planes [][2]int64
	for slot := int64(0); slot < r.slots; slot++ {
		planes = append(planes, [2]int64{r.colourAt + slot*r.colourStride, 16 * r.w * r.h},
			[2]int64{r.depthAt + slot*r.depthStride, 4 * r.w * r.h})
	}
	sort.Slice(planes, func(i, j int) bool { return planes[i][0] < planes[j][0] })
	end := int64(0)
	for _, plane := range planes {
		if plane[0] < end {
			return nil, errors.New("planes overlap (MEM-9)")
		}
		end = plane[0] + plane[1]
	}
	r.need = size
	return r, nil
}

func (r *ring) open() error {
	file, err := os.Open("/dev/shm/" + r.name)
	if err != nil {
		return err
	}
	defer file.Close()
	about, err := file.Stat()
	if err != nil || about.Size() < r.need {
		return fmt.Errorf("memory is %d bytes long, %d were announced (MEM-6)", about.Size(), r.need)
	}
	r.memory, err = syscall.Mmap(int(file.Fd()), 0, int(r.need), syscall.PROT_READ, syscall.MAP_SHARED)
	return err
}

func (r *ring) look(slot int64) {
	at := r.colourAt + slot*r.colourStride
	for end := at + 16*r.w*r.h; at < end; at += 4 {
		if value := math.Float32frombits(binary.LittleEndian.Uint32(r.memory[at:])); value > r.brightest {
			r.brightest = value
		}
	}
}

type images struct {
	*link
	shown   *ring
	waiting object // an init packet that came before welcome
	last    float64
	packets int
}

func (v *images) opened(packet object) error {
	generation, ok := whole(packet, "generation", 1, safe)
	if !ok || float64(generation) <= v.last || (v.packets > 0 && !v.granted["reinit"]) {
		return nil
	}
	v.packets++
	v.last = float64(generation)
	next, err := checked(packet)
	if err == nil {
		err = next.open()
	}
	if err != nil {
		if said := v.say(object{"type": "open_failed", "generation": generation, "reason": err.Error()}); said != nil {
			return said
		}
		next = nil
	} else {
		next.generation = v.last
		if said := v.say(object{"type": "opened", "generation": generation}); said != nil {
			return said
		}
	}
	former := v.shown
	v.shown = next
	if former != nil {
		syscall.Munmap(former.memory)
		return v.say(object{"type": "closed", "generation": former.generation})
	}
	return nil
}

func (v *images) frame(message object) error {
	seq, ok := whole(message, "seq", 0, safe)
	slot, there := whole(message, "slot", 0, 1023)
	if v.shown == nil || !v.granted["frames"] || !ok || !there || slot >= v.shown.slots ||
		message["generation"] != v.shown.generation {
		return nil
	}
	v.shown.look(slot)
	return v.say(object{"type": "release", "generation": v.shown.generation, "seq": seq})
}

func (v *images) take(message object) error {
	_, meta := message["meta"]
	_, typed := message["type"]
	switch {
	case one(message, "type", "welcome"):
		if err := v.welcomed(message); err != nil || v.version != "1.1" || v.waiting == nil {
			return err
		}
		packet := v.waiting
		v.waiting = nil
		return v.opened(packet)
	case one(message, "type", "frame") && v.version == "1.1":
		return v.frame(message)
	case one(message, "type", "error"):
		v.blamed = true
	case meta && !typed:
		if _, later := message["version"]; !later && v.version == "" {
			v.version = "1.0"
		} else if later && v.version == "" && v.waiting == nil {
			v.waiting = message
		} else if later && v.version == "1.1" {
			return v.opened(message)
		}
	}
	return nil
}

func watch(l *link) {
	v := &images{link: l}
	if l.hello("host_shm", "frames", "reinit") == nil {
		for {
			payload, err := l.packet()
			if err != nil {
				break
			}
			if message, err := parse(payload); err == nil && v.take(message) != nil {
				break
			}
		}
	}
	if v.shown != nil {
		syscall.Munmap(v.shown.memory)
	}
}

// ---- the camera ----

type turned struct { // in the order in which the deployed server wants them
	X, Y, Z, W float64
}

func (q turned) MarshalJSON() ([]byte, error) {
	return []byte(fmt.Sprintf(`{"x":%g,"y":%g,"z":%g,"w":%g}`, q.X, q.Y, q.Z, q.W)), nil
}

func (l *link) look(turn float64) error {
	made := object{"type": "camera_pose", "timestamp": time.Since(start).Seconds(),
		"position": object{"x": math.Sin(turn), "y": 0.25, "z": -4.5},
		"rotation": turned{0, math.Sin(turn / 8), 0, math.Cos(turn / 8)}}
	if l.granted["intrinsics"] {
		made["intrinsics"] = object{"fx": 60, "fy": 60, "cx": 32, "cy": 24, "width": 64, "height": 48, "near": 0.01, "far": 100}
	}
	return l.say(made)
}

func steer(l *link) {
	known := make(chan bool, 1)
	if l.hello("intrinsics") != nil || l.say(object{"type": "get_viewport_size"}) != nil {
		return
	}
	go func() {
		select {
		case <-known:
		case <-time.After(9 * time.Second):
			l.conn.Close()
		}
		for turn := 0.0; l.look(turn) == nil; turn += 0.02 {
			time.Sleep(40 * time.Millisecond)
		}
	}()
	for asked := true; ; {
		payload, err := l.packet()
		if err != nil {
			return
		}
		message, err := parse(payload)
		switch {
		case one(message, "type", "welcome"):
			err = l.welcomed(message)
		case one(message, "type", "error"):
			l.blamed = true
			if asked && l.version == "1.1" && !one(message, "code", "busy") {
				asked = false
				known <- true
			}
		case asked && message["viewport_size"] != nil:
			asked = false
			if l.version == "" {
				l.version = "1.0"
			}
			known <- true
		}
		if err != nil && asked {
			return // it may have been the reply
		}
	}
}

func forever(variable, usual string, talk func(*link)) {
	pause := 120 * time.Millisecond
	for {
		begun := time.Now()
		l, err := dial(variable, usual)
		if err == nil {
			talk(l)
			l.conn.Close()
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
