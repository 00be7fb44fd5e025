package main

import (
	"encoding/binary"
	"math"
	"sort"
)

const (
	width, height = 64, 48
	near, far     = 0.01, 100.0
	focal         = 60.0
	colorBytes    = 16 * width * height
	depthBytes    = 4 * width * height
	slots         = readersKept + 2
)

type pose struct {
	p [3]float64
	q [4]float64
}

var rest = pose{q: [4]float64{0, 0, 0, 1}}

type blob struct {
	at, color      [3]float64
	sigma, opacity float64
}

// A few soft splats with nothing between them.
var blobs = []blob{
	{[3]float64{0, 0, 4}, [3]float64{0.9, 0.3, 0.2}, 0.35, 0.9},
	{[3]float64{-1.5, 0.5, 5}, [3]float64{0.2, 0.8, 0.3}, 0.3, 0.8},
	{[3]float64{1.6, -0.4, 3.5}, [3]float64{0.3, 0.4, 0.95}, 0.25, 0.85},
	{[3]float64{0.9, 1.1, 6}, [3]float64{0.95, 0.9, 0.3}, 0.45, 0.7},
	{[3]float64{-0.8, -1.2, 4.5}, [3]float64{0.8, 0.3, 0.9}, 0.2, 0.95},
	{[3]float64{2.4, 0.9, 5.5}, [3]float64{0.3, 0.9, 0.9}, 0.4, 0.6},
}

func rotation(q [4]float64) [3][3]float64 {
	x, y, z, w := q[0], q[1], q[2], q[3]
	s := 2 / (x*x + y*y + z*z + w*w)
	return [3][3]float64{
		{s / 2 * (w*w + x*x - y*y - z*z), s * (x*y - z*w), s * (x*z + y*w)},
		{s * (x*y + z*w), s / 2 * (w*w - x*x + y*y - z*z), s * (y*z - x*w)},
		{s * (x*z - y*w), s * (y*z + x*w), s / 2 * (w*w - x*x - y*y + z*z)},
	}
}

func into(p pose, from [3]float64) [3]float64 { // world to its axes
	m, d, found := rotation(p.q), [3]float64{}, [3]float64{}
	for i := range d {
		d[i] = from[i] - p.p[i]
	}
	for i := range found {
		found[i] = m[0][i]*d[0] + m[1][i]*d[1] + m[2][i]*d[2]
	}
	return found
}

func outOf(p pose, from [3]float64) [3]float64 {
	m, found := rotation(p.q), p.p
	for i := range found {
		found[i] += m[i][0]*from[0] + m[i][1]*from[1] + m[i][2]*from[2]
	}
	return found
}

// draw blends the blobs from front to back into a slot; its depth is the expected one.
func draw(camera, cloud pose, color, depth []byte) {
	type seen struct {
		blob
		x, y, z, radius float64
	}
	order := []seen{}
	for _, b := range blobs {
		c := into(camera, outOf(cloud, b.at))
		if x, y := width/2+focal*c[0]/c[2], height/2+focal*c[1]/c[2]; c[2] >= near && c[2] <= far {
			order = append(order, seen{b, x, y, c[2], focal * b.sigma / c[2]})
		}
	}
	sort.Slice(order, func(i, j int) bool { return order[i].z < order[j].z })
	for i := 0; i < height; i++ {
		for j := 0; j < width; j++ {
			var sum [3]float64
			total, through, deep := 0.0, 1.0, 0.0
			for _, b := range order {
				dx, dy := (float64(j)+0.5-b.x)/b.radius, (float64(i)+0.5-b.y)/b.radius
				weight := b.opacity * math.Exp(-0.5*(dx*dx+dy*dy)) * through
				if weight < 1.0/255*through {
					continue
				}
				for k := range sum {
					sum[k] += weight * b.color[k]
				}
				total, through, deep = total+weight, through-weight, deep+weight*b.z
			}
			at := (height-1-i)*width + j
			pixel := [4]float32{}
			z := float32(math.Inf(1))
			if total >= 1.0/255 {
				for k := range sum {
					pixel[k] = float32(math.Min(1, sum[k]/total))
				}
				pixel[3], z = float32(total), float32(deep/total)
			}
			for k, each := range pixel {
				binary.LittleEndian.PutUint32(color[16*at+4*k:], math.Float32bits(each))
			}
			binary.LittleEndian.PutUint32(depth[4*at:], math.Float32bits(z))
		}
	}
}
