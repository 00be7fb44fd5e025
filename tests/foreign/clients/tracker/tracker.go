// A head tracker: says 200 times a second where the head is. It wants no images and asks nothing.
package main

import (
	"bufio"
	"encoding/binary"
	"errors"
	"io"
	"log"
	"math"
	"net"
	"os"
	"strconv"
	"time"
)

const (
	period  = 5 * time.Millisecond
	longest = 1 << 20
	again   = time.Second
)

func env(name, otherwise string) string {
	if value := os.Getenv(name); value != "" {
		return value
	}
	return otherwise
}

// sensor is a made-up inertial sensor: it drifts about a chair.
type sensor struct{ begun time.Time }

func (s sensor) pose(out []byte) []byte {
	t := time.Since(s.begun).Seconds()
	yaw, pitch := 0.6*math.Sin(0.7*t), 0.2*math.Sin(1.3*t)
	cy, sy := math.Cos(yaw/2), math.Sin(yaw/2)
	cp, sp := math.Cos(pitch/2), math.Sin(pitch/2)
	field := func(name string, value float64) {
		out = append(out, name...)
		out = strconv.AppendFloat(out, value, 'g', -1, 64)
	}
	field(`{"type":"camera_pose","timestamp":`, t)
	field(`,"position":{"x":`, 0.3*math.Sin(t))
	field(`,"y":`, -1.6+0.02*math.Sin(5*t))
	field(`,"z":`, 0.2*math.Cos(t))
	field(`},"rotation":{"x":`, cy*sp)
	field(`,"y":`, sy*cp)
	field(`,"z":`, -sy*sp)
	field(`,"w":`, cy*cp)
	return append(out, "}}"...)
}

// discard takes packets off the wire until something is wrong with one.
func discard(conn net.Conn, ended chan<- error) {
	reader := bufio.NewReader(conn)
	for {
		if _, err := reader.Peek(1); err != nil {
			ended <- err
			return
		}
		conn.SetReadDeadline(time.Now().Add(9500 * time.Millisecond))
		var length uint32
		err := binary.Read(reader, binary.LittleEndian, &length)
		if err == nil && (length == 0 || length > longest) {
			err = errors.New("a length of " + strconv.Itoa(int(length)))
		}
		if err == nil {
			_, err = io.CopyN(io.Discard, reader, int64(length))
		}
		if err != nil {
			ended <- err
			return
		}
		conn.SetReadDeadline(time.Time{})
	}
}

func track(conn net.Conn) error {
	defer conn.Close()
	ended := make(chan error, 1)
	go discard(conn, ended)
	tick := time.NewTicker(period)
	defer tick.Stop()
	s := sensor{time.Now()}
	for {
		select {
		case err := <-ended:
			return err
		case <-tick.C:
			packet := s.pose(make([]byte, 4, 256))
			binary.LittleEndian.PutUint32(packet, uint32(len(packet)-4))
			conn.SetWriteDeadline(time.Now().Add(3 * time.Second))
			if _, err := conn.Write(packet); err != nil {
				return err
			}
		}
	}
}

func main() {
	address := net.JoinHostPort(env("SPLATBUS_HOST", "127.0.0.1"), env("SPLATBUS_MSG_PORT", "6000"))
	for {
		begun := time.Now()
		conn, err := net.DialTimeout("tcp", address, 3*time.Second)
		if err == nil {
			err = track(conn)
		}
		log.Print(err)
		time.Sleep(time.Until(begun.Add(again)))
	}
}
