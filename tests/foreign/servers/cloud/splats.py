"""A spiral of Gaussians and a lamp, projected as splatting rasterisers do it."""

import math

REST = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 1.0)
CUT = 1 / 255


def matrix(q):
    x, y, z, w = q
    s = 2 / (x * x + y * y + z * z + w * w)
    return (
        (s / 2 * (w * w + x * x - y * y - z * z), s * (x * y - z * w), s * (x * z + y * w)),
        (s * (x * y + z * w), s / 2 * (w * w - x * x + y * y - z * z), s * (y * z - x * w)),
        (s * (x * z - y * w), s * (y * z + x * w), s / 2 * (w * w - x * x - y * y + z * z)),
    )


def times(a, b):
    return tuple(tuple(sum(x * y for x, y in zip(row, col)) for col in zip(*b)) for row in a)


def apply(m, v):
    return tuple(sum(x * y for x, y in zip(row, v)) for row in m)


def transposed(m):
    return tuple(zip(*m))


def gaussian(mean, sizes, q, colour, opacity):
    m = matrix(q)
    scaled = tuple(tuple(x * s for x, s in zip(row, sizes)) for row in m)
    return mean, times(scaled, transposed(scaled)), colour, opacity


def spiral():
    for k in range(16):
        t = 0.55 * k
        mean = (1.3 * math.cos(t), 0.16 * k - 1.2, 1.3 * math.sin(t))
        colour = tuple(0.5 + 0.45 * math.sin(t + shift) for shift in (0.0, 2.1, 4.2))
        half = t / 2
        yield gaussian(mean, (0.45, 0.12, 0.2), (0.0, -math.sin(half), 0.0, math.cos(half)), colour, 0.9)


OBJECTS = {
    "default": list(spiral()),
    "lamp": [
        gaussian((0.0, -1.8, 0.0), (0.3, 0.3, 0.3), (0.0, 0.0, 0.0, 1.0), (1.0, 0.95, 0.6), 0.8),
        gaussian((0.0, -1.3, 0.0), (0.05, 0.4, 0.05), (0.0, 0.0, 0.0, 1.0), (0.2, 0.2, 0.25), 0.95),
    ],
}


def bounds(name):
    means = [each[0] for each in OBJECTS[name]]
    return [min(c) for c in zip(*means)], [max(c) for c in zip(*means)]


def projected(camera, lens, poses):
    """Nearest first: depth, centre and inverse covariance in pixels, colour, opacity."""
    into, (cx, cy, cz) = transposed(matrix(camera[1])), camera[0]
    found = []
    for name, gaussians in OBJECTS.items():
        place, q, scale = poses.get(name, REST)
        turn = matrix(q)
        whole = times(into, turn)
        offset = apply(into, tuple(p - c for p, c in zip(place, (cx, cy, cz))))
        for mean, covariance, colour, opacity in gaussians:
            x, y, z = (scale * a + b for a, b in zip(apply(whole, mean), offset))
            if not lens["near"] <= z <= lens["far"] or not math.isfinite(x) or not math.isfinite(y):
                continue
            fx, fy = lens["fx"], lens["fy"]
            j = ((fx / z, 0.0, -fx * x / z / z), (0.0, fy / z, -fy * y / z / z))
            turned = times(times(whole, covariance), transposed(whole))
            (a, b), (_, c) = times(times(j, turned), transposed(j))
            a, b, c = a * scale * scale + 0.3, b * scale * scale, c * scale * scale + 0.3
            area = a * c - b * b
            if not (math.isfinite(area) and area > 0):
                continue
            centre = fx * x / z + lens["cx"], fy * y / z + lens["cy"]
            reach = math.sqrt(2 * math.log(255 * opacity))
            found.append((z, centre, (c / area, -b / area, a / area), reach * math.sqrt(a), reach * math.sqrt(c), colour, opacity))
    found.sort(key=lambda splat: splat[0])
    return found


def drawn(camera, lens, poses):
    """Colour, premultiplied, and depth, rows from the bottom up."""
    splats = projected(camera, lens, poses)
    color, depth = [], []
    for i in reversed(range(lens["height"])):
        row = [s for s in splats if abs(i + 0.5 - s[1][1]) <= s[4]]
        for j in range(lens["width"]):
            r = g = b = total = far = 0.0
            left = 1.0
            for z, (u, v), (a, h, c), wide, _, colour, opacity in row:
                du, dv = j + 0.5 - u, i + 0.5 - v
                if abs(du) > wide:
                    continue
                power = -0.5 * (a * du * du + c * dv * dv) - h * du * dv
                alpha = opacity * math.exp(power) if power <= 0 else 0.0
                if alpha < CUT:
                    continue
                weight = min(alpha, 0.99) * left
                left *= 1 - min(alpha, 0.99)
                r, g, b = (sofar + weight * part for sofar, part in zip((r, g, b), colour))
                total += weight
                far += weight * z
            color += (min(r, 1.0), min(g, 1.0), min(b, 1.0), min(total, 1.0))
            depth.append(far / total if total >= CUT and far > 0 else math.inf)
    return color, depth
