package main

import (
	"errors"
	"math"
	"regexp"
	"strconv"
	"strings"
	"unicode/utf8"
)

var (
	errText = errors.New("no text that I take")
	numeral = regexp.MustCompile(`^-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?`)
)

type object = map[string]any

// read takes one JSON object apart: nothing twice, nothing infinite, nothing too deep.
func read(payload []byte) (value object, err error) {
	defer func() {
		if recover() != nil {
			value, err = nil, errText
		}
	}()
	if !utf8.Valid(payload) {
		return nil, errText
	}
	r := &reader{rest: string(payload)}
	value = r.value(1).(object)
	if r.peek() != 0 {
		return nil, errText
	}
	return value, nil
}

type reader struct{ rest string }

func (r *reader) peek() byte {
	r.rest = strings.TrimLeft(r.rest, " \t\r\n")
	if r.rest == "" {
		return 0
	}
	if r.rest[0] == 0 {
		panic(errText)
	}
	return r.rest[0]
}

func (r *reader) take(text string) {
	r.peek()
	if !strings.HasPrefix(r.rest, text) {
		panic(errText)
	}
	r.rest = r.rest[len(text):]
}

func (r *reader) value(depth int) any {
	switch c := r.peek(); {
	case c == '{' || c == '[':
		if depth > 64 {
			panic(errText)
		}
		if c == '{' {
			return r.members(depth)
		}
		return r.items(depth)
	case c == '"':
		return r.text()
	case c == 't':
		r.take("true")
		return true
	case c == 'f':
		r.take("false")
		return false
	case c == 'n':
		r.take("null")
		return nil
	}
	spelled := numeral.FindString(r.rest)
	number, err := strconv.ParseFloat(spelled, 64)
	if err != nil || math.IsInf(number, 0) {
		panic(errText)
	}
	r.rest = r.rest[len(spelled):]
	return number
}

func (r *reader) members(depth int) object {
	found := object{}
	for separator := "{"; ; separator = "," {
		r.take(separator)
		if separator == "{" && r.peek() == '}' {
			break
		}
		r.peek()
		name := r.text()
		if _, twice := found[name]; twice {
			panic(errText)
		}
		r.take(":")
		found[name] = r.value(depth + 1)
		if r.peek() == '}' {
			break
		}
	}
	r.take("}")
	return found
}

func (r *reader) items(depth int) []any {
	found := []any{}
	for separator := "["; ; separator = "," {
		r.take(separator)
		if separator == "[" && r.peek() == ']' {
			break
		}
		found = append(found, r.value(depth+1))
		if r.peek() == ']' {
			break
		}
	}
	r.take("]")
	return found
}

func (r *reader) text() string {
	r.take(`"`)
	var built strings.Builder
	for {
		c := r.rest[0]
		r.rest = r.rest[1:]
		switch {
		case c == '"':
			return built.String()
		case c < ' ':
			panic(errText)
		case c != '\\':
			built.WriteByte(c)
		case r.rest[0] == 'u':
			one := r.unit()
			if one >= 0xd800 && one < 0xdc00 && strings.HasPrefix(r.rest, `\u`) {
				r.rest = r.rest[1:]
				two := r.unit()
				if two < 0xdc00 || two > 0xdfff {
					panic(errText)
				}
				one = 0x10000 + (one-0xd800)<<10 + two - 0xdc00
			} else if one >= 0xd800 && one < 0xe000 {
				panic(errText)
			}
			built.WriteRune(one)
		default:
			at := strings.IndexByte(`"\/bfnrt`, r.rest[0])
			built.WriteByte("\"\\/\b\f\n\r\t"[at])
			r.rest = r.rest[1:]
		}
	}
}

func (r *reader) unit() rune {
	digits, err := strconv.ParseUint(r.rest[1:5], 16, 16)
	if err != nil || strings.ContainsAny(r.rest[1:5], "+_") {
		panic(errText)
	}
	r.rest = r.rest[5:]
	return rune(digits)
}
