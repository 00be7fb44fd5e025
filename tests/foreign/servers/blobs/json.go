package main

import (
	"bytes"
	"encoding/json"
	"math"
	"regexp"
	"strconv"
	"strings"
	"unicode/utf8"
)

const deepest = 64

type object = map[string]any

var escape = regexp.MustCompile(`\\(u[dD][89abAB]..\\u[dD][c-fC-F]..|u[dD][89a-fA-F]..|.)`)

// read takes a payload for a message by JSN-1 to JSN-5, or says by which code of `error` it is none.
func read(payload []byte) (object, string) {
	if !utf8.Valid(payload) || !json.Valid(payload) {
		return nil, "malformed_json"
	}
	for _, each := range escape.FindAll(payload, -1) {
		if len(each) == 6 { // half a surrogate pair
			return nil, "malformed_json"
		}
	}
	tokens := json.NewDecoder(bytes.NewReader(payload))
	tokens.UseNumber()
	value, right := walk(tokens, 0)
	if !right {
		return nil, "malformed_json"
	}
	message, is := value.(object)
	if !is {
		return nil, "not_an_object"
	}
	return message, ""
}

func walk(tokens *json.Decoder, depth int) (any, bool) {
	token, err := tokens.Token()
	if err != nil {
		return nil, false
	}
	switch it := token.(type) {
	case json.Number:
		number, err := strconv.ParseFloat(string(it), 64)
		return number, err == nil
	case json.Delim:
		if depth == deepest {
			return nil, false
		}
		found, list, right := object{}, []any{}, true
		for right && tokens.More() {
			name := ""
			if it == '{' {
				token, _ := tokens.Token()
				name = token.(string)
				_, twice := found[name]
				right = !twice
			}
			value, sound := walk(tokens, depth+1)
			found[name], list, right = value, append(list, value), right && sound
		}
		tokens.Token()
		if it == '{' {
			return found, right
		}
		return list, right
	}
	return token, true
}

func integer(value any, least, most float64) (int64, bool) {
	number, is := value.(float64)
	return int64(number), is && number == math.Trunc(number) && least <= number && number <= most
}

func text(value any, least, most int) bool {
	it, is := value.(string)
	return is && utf8.RuneCountInString(it) >= least && utf8.RuneCountInString(it) <= most
}

// wrong is what a message breaks: the code and the pointer of an `error`.
type wrong struct{ code, pointer string }

func invalid(pointer string) *wrong { return &wrong{"invalid_message", pointer} }

func vector(of any, names, pointer string) ([]float64, *wrong) {
	members, is := of.(object)
	if !is {
		return nil, invalid(pointer)
	}
	found := []float64{}
	for _, name := range strings.Split(names, "") {
		number, is := members[name].(float64)
		if !is {
			return nil, invalid(pointer + "/" + name)
		}
		found = append(found, number)
	}
	return found, nil
}

func poseOf(message object) (pose, *wrong) {
	p, bad := vector(message["position"], "xyz", "/position")
	if bad != nil {
		return pose{}, bad
	}
	q, bad := vector(message["rotation"], "xyzw", "/rotation")
	if bad != nil {
		return pose{}, bad
	}
	for i, each := range p {
		if math.Abs(each) > math.MaxFloat32 {
			return pose{}, &wrong{"invalid_number", "/position/" + "xyz"[i:i+1]}
		}
	}
	if !(math.Abs(math.Sqrt(q[0]*q[0]+q[1]*q[1]+q[2]*q[2]+q[3]*q[3])-1) <= 0.01) {
		return pose{}, &wrong{"invalid_rotation", "/rotation"}
	}
	return pose{[3]float64{p[0], p[1], p[2]}, [4]float64{q[0], q[1], q[2], q[3]}}, nil
}

func versionsOf(hello object) ([]string, bool) {
	listed, is := hello["versions"].([]any)
	if !is || len(listed) < 1 || len(listed) > 16 {
		return nil, false
	}
	found := []string{}
	for _, each := range listed {
		it, is := each.(string)
		if !is || len(it) > 64 || !regexp.MustCompile(`^(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)$`).MatchString(it) {
			return nil, false
		}
		found = append(found, it)
	}
	return found, true
}

// breach is the pointer to what breaks NEG-2 in a hello, or "".
func breach(hello object) string {
	if _, right := versionsOf(hello); !right {
		return "/versions"
	}
	client, is := hello["client"].(object)
	if !is || !text(client["name"], 0, 64) || !text(client["version"], 0, 64) {
		return "/client"
	}
	listed, is := hello["capabilities"].([]any)
	seen := map[any]bool{}
	for _, each := range listed {
		if !text(each, 0, 64) || seen[each] {
			return "/capabilities"
		}
		seen[each] = true
	}
	if !is || len(listed) > 64 {
		return "/capabilities"
	}
	if token, has := hello["token"]; has && !text(token, 1, 256) {
		return "/token"
	}
	return ""
}
