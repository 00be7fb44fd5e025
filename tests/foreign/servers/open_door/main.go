// A server of SplatBus 1.0 as encoding/json and net make it easy.
package main

import (
	"encoding/binary"
	"encoding/json"
	"io"
	"math"
	"net"
	"os"
	"sync"
)

type xyzw struct {
	X, Y, Z, W *float64
}

type message struct {
	Type     string `json:"type"`
	CamIdx   int64  `json:"cam_idx"`
	Position *xyzw  `json:"position"`
	Rotation *xyzw  `json:"rotation"`
}

type camera struct {
	Position [3]float64 `json:"position"`
	Rotation [4]float64 `json:"rotation"`
}

var (
	mu      sync.Mutex
	scene   = map[string]message{}
	cameras = []camera{{[3]float64{0, 0, -4}, [4]float64{0, 0, 0, 1}}, {[3]float64{1, 2, -3}, [4]float64{0, 0.6, 0, 0.8}}}
)

func say(conn net.Conn, reply any) {
	payload, _ := json.Marshal(reply)
	conn.Write(append(binary.LittleEndian.AppendUint32(nil, uint32(len(payload))), payload...))
}

func all(numbers ...*float64) bool {
	for _, each := range numbers {
		if each == nil || math.Abs(*each) > math.MaxFloat32 {
			return false
		}
	}
	return true
}

func handle(conn net.Conn, m message) {
	mu.Lock() // held while the reply is written, so that the scene is of one moment
	defer mu.Unlock()
	switch m.Type {
	case "camera_pose", "point_cloud_pose":
		p, r := m.Position, m.Rotation
		if p == nil || r == nil || !all(p.X, p.Y, p.Z, r.X, r.Y, r.Z, r.W) {
			return
		}
		if math.Abs(math.Sqrt(*r.X**r.X+*r.Y**r.Y+*r.Z**r.Z+*r.W**r.W)-1) <= 0.01 {
			scene[m.Type] = m
		}
	case "get_viewport_size":
		say(conn, map[string][2]int{"viewport_size": {800, 600}})
	case "get_camera_pose":
		count := int64(len(cameras))
		say(conn, cameras[(m.CamIdx%count+count)%count])
	}
}

func serve(conn net.Conn, speaks bool) {
	defer conn.Close()
	header := make([]byte, 4)
	for {
		if _, err := io.ReadFull(conn, header); err != nil {
			return
		}
		payload := make([]byte, binary.LittleEndian.Uint32(header))
		if _, err := io.ReadFull(conn, payload); err != nil {
			return
		}
		var m message
		if err := json.Unmarshal(payload, &m); err == nil && speaks {
			handle(conn, m)
		}
	}
}

func listen(variable, otherwise string, speaks bool) {
	port := os.Getenv(variable)
	if port == "" {
		port = otherwise
	}
	listener, err := net.Listen("tcp", ":"+port)
	if err != nil {
		panic(err)
	}
	for {
		if conn, err := listener.Accept(); err == nil {
			go serve(conn, speaks)
		}
	}
}

func main() {
	go listen("SPLATBUS_IPC_PORT", "6001", false)
	listen("SPLATBUS_MSG_PORT", "6000", true)
}
