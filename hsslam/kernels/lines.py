"""Lines through neighbouring returns, over as much of a surface as the returns' noise calls for.

Where the surface is bent, the line is its tangent: a straight line through the returns of a pillar lies behind its
front, and the part of it that the scan sees decides by how much.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points

ARM = 0.15
"""Noise is told from a return's distance from a chord that ends this far from it on either side (m)."""

LONG = 0.2
"""Noise over the length of a chord's arm, at most: else the arm is too short to tell."""

MEDIAN = 0.6745
"""Median of the absolute value of a normal variate of standard deviation 1."""

ENOUGH = 5
"""Chords that tell of noise, at least."""

PLENTY = 120
"""Returns that are asked, at most: a median needs no more."""

STEADY = 0.12
"""Standard deviation (rad) of a line's direction, up to which no more returns are needed."""

WIDENINGS = 3
"""How often the stretch of surface may be doubled."""

SAME = 1.5
"""Returns of a plain surface stray from its line by no more than this many standard deviations of the noise (rms)."""

VAGUE = 0.35
"""Standard deviation (rad) of a line's direction, from which on it points nowhere."""

UNBENT = 1.5
"""Noise is at most this many times what it is with the bends of the surface taken off. Some of what bends add is to
stay: over uneven surfaces, too, a line is to be fitted to more returns. Where nearly all is round it must not."""

BENT = 3.0
"""A surface is bent where that shows by this many standard deviations of what it is told by."""

LEAST_BENT = 5
"""Returns that tell of a bend, at least."""


@kernel
def noise_of(points: Points, joined: NDArray[np.bool_]) -> float:
    """Standard deviation (m) of returns across the surface that they lie on, from the returns themselves.

    The median of the distances of up to `PLENTY` of them, spread over all, from chords to either side, as it would be
    on plain surfaces: what corners and edges add are outliers to it, and what bends add is limited, see `UNBENT`. 0
    where too few returns have neighbours to tell.
    """
    noise = _noise_about_chords(points, joined, ARM)
    if noise > LONG * ARM:
        # Returns that noise took far away end chords that are too short for it.
        return min(noise, _noise_about_chords(points, joined, noise / LONG))
    return noise


@kernel
def _noise_about_chords(points: Points, joined: NDArray[np.bool_], arm: float) -> float:
    """As `noise_of`, with chords of a given length to either side (m)."""
    n = points.shape[0]
    found, unbent = np.empty(n), np.empty(n)
    count = 0
    for i in range(1, n - 1, 1 + n // PLENTY):
        a = _end_of_arm(points, i, -1, joined, arm)
        b = _end_of_arm(points, i, 1, joined, arm)
        dx, dy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
        squared = dx * dx + dy * dy
        if a == i or b == i or squared < arm * arm:
            continue
        t, off = _from_chord(points, a, i, dx, dy)
        if not 0.1 < t < 0.9:
            continue
        # The chord's ends are as noisy as the return.
        of_a, of_b = 1.0 - t, t
        found[count] = unbent[count] = abs(off) / math.sqrt(1.0 + of_a * of_a + of_b * of_b)
        j = (i + b) // 2 if b - i >= i - a else (a + i) // 2
        if j not in (i, a):
            # A bend takes another return from the chord, too, by a share that follows from where it is along it.
            s, other = _from_chord(points, a, j, dx, dy)
            if 0.1 < s < 0.9:
                share = t * (1.0 - t) / (s * (1.0 - s))
                of_a, of_b = of_a - share * (1.0 - s), of_b - share * s
                unbent[count] = abs(off - share * other) / math.sqrt(
                    1.0 + of_a * of_a + of_b * of_b + share * share
                )
        count += 1
    if count < ENOUGH:
        return 0.0
    return min(float(np.median(found[:count])), UNBENT * float(np.median(unbent[:count]))) / MEDIAN


@kernel
def _from_chord(points: Points, a: int, i: int, dx: float, dy: float) -> tuple[float, float]:
    """Where return ``i`` is along the chord ``(dx, dy)`` from return ``a``, as a share of it; how far across (m)."""
    px, py = points[i, 0] - points[a, 0], points[i, 1] - points[a, 1]
    squared = dx * dx + dy * dy
    return (px * dx + py * dy) / squared, (px * dy - py * dx) / math.sqrt(squared)


@kernel
def _end_of_arm(points: Points, i: int, step: int, joined: NDArray[np.bool_], arm: float) -> int:
    """The first return ``arm`` (m) from return ``i`` along the surface, or the last before the surface ends."""
    j = i
    while 0 <= j + step < points.shape[0]:
        k = j + step
        if not joined[min(j, k)]:
            break
        j = k
        rx, ry = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        if rx * rx + ry * ry > arm * arm:
            break
    return j


@kernel
def fit_line(
    points: Points,
    i: int,
    joined: NDArray[np.bool_],
    span: float,
    roughness: float,
    noise: float,
    out: NDArray[np.float64],
) -> None:
    """Fit a line to the points around segment ``i``, ``i + 1``; into ``out`` (6,): point, normal, tilt, variance.

    The normal is to the left of who goes along the surface in the order of the points, so that the two sides of a
    thin wall have opposite ones. The latter two are those of `Surface.tilts`.

    The stretch grows by a point at each end in turn while it stays connected and within half of ``span`` of the
    segment's middle. It is doubled while ``noise`` leaves the line's direction uncertain and the points are as near to
    the line as noise alone would have them. With too rough a fit the segment itself is the line.
    """
    dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
    length = math.sqrt(dx * dx + dy * dy)
    out[0], out[1] = 0.5 * (points[i, 0] + points[i + 1, 0]), 0.5 * (points[i, 1] + points[i + 1, 1])
    if length > 0.0:
        out[2], out[3] = -dy / length, dx / length
        out[4] = 2.0 / (length * length)
    else:
        out[2], out[3], out[4] = 0.0, 0.0, 0.0
    out[5] = 0.0
    strays = max(roughness, SAME * noise)
    for _ in range(WIDENINGS + 1):
        _fit_within(points, i, joined, span, strays, noise, out)
        if noise * noise * out[4] <= STEADY * STEADY:
            return
        span *= 2.0
        strays = SAME * noise
    if noise * noise * out[4] > VAGUE * VAGUE:
        out[2], out[3], out[4], out[5] = 0.0, 0.0, 0.0, 0.0


@kernel
def _fit_within(
    points: Points,
    i: int,
    joined: NDArray[np.bool_],
    span: float,
    roughness: float,
    noise: float,
    out: NDArray[np.float64],
) -> None:
    """Fit a line to the points within a stretch, unless they stray from it or are not more than the segment's two.

    Where they are ``noise`` (m) about a bend rather than about the line, it is the tangent at the segment's middle.
    """
    n = points.shape[0]
    mx = 0.5 * (points[i, 0] + points[i + 1, 0])
    my = 0.5 * (points[i, 1] + points[i + 1, 1])
    limit = 0.25 * span * span
    first, last = i, i + 1
    for step in (-1, 1):
        j = i if step < 0 else i + 1
        while 0 <= j + step < n:
            k = j + step
            rx, ry = points[k, 0] - mx, points[k, 1] - my
            if not joined[min(j, k)] or rx * rx + ry * ry > limit:
                break
            j = k
        if step < 0:
            first = j
        else:
            last = j
    count = last - first + 1
    if count <= 2:
        return
    cx = cy = 0.0
    for j in range(first, last + 1):
        cx += points[j, 0]
        cy += points[j, 1]
    cx /= count
    cy /= count
    xx = xy = yy = 0.0
    for j in range(first, last + 1):
        dx, dy = points[j, 0] - cx, points[j, 1] - cy
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
    half_trace = 0.5 * (xx + yy)
    root = math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
    if half_trace - root > roughness * roughness * count or root == 0.0:
        return
    # The long axis of the scatter, in the form that does not cancel.
    across = 0.5 * (xx - yy)
    ux, uy = (across + root, xy) if across > 0.0 else (xy, root - across)
    length = math.sqrt(ux * ux + uy * uy)
    if ux * (points[last, 0] - points[first, 0]) + uy * (points[last, 1] - points[first, 1]) < 0.0:
        length = -length
    ux, uy = ux / length, uy / length
    out[0], out[1] = cx, cy
    out[2], out[3] = -uy, ux
    out[4] = 1.0 / (half_trace + root)
    rough = max(half_trace - root, 0.0)
    out[5] = rough / (count - 2)
    if count >= LEAST_BENT and rough > BENT * BENT * noise * noise:
        _bend(points, first, last, mx - cx, my - cy, noise, out)


@kernel
def _bend(
    points: Points, first: int, last: int, at_x: float, at_y: float, noise: float, out: NDArray[np.float64]
) -> None:
    """Take the tangent of a parabola for the line, if points ``first`` to ``last`` tell that the surface is bent.

    ``out`` holds the line, which goes through their mean along the long axis of their scatter; ``(at_x, at_y)`` from
    there (m) is where the tangent is to touch.
    """
    cx, cy, ux, uy = out[0], out[1], out[3], -out[2]
    count = last - first + 1
    s2 = s3 = s4 = bent = 0.0
    for j in range(first, last + 1):
        dx, dy = points[j, 0] - cx, points[j, 1] - cy
        t, y = ux * dx + uy * dy, ux * dy - uy * dx
        tt = t * t
        s2 += tt
        s3 += tt * t
        s4 += tt * tt
        bent += tt * y
    free = s4 - s2 * s2 / count - s3 * s3 / s2
    if free <= 1e-6 * s4:
        return
    c = bent / free
    left = max(out[5] * (count - 2) - c * bent, 0.0) / (count - 3)
    if c * bent <= BENT * BENT * max(noise * noise, left):
        return
    a, b = -c * s2 / count, -c * s3 / s2
    t = ux * at_x + uy * at_y
    y, slope = a + (b + c * t) * t, b + 2.0 * c * t
    out[0], out[1] = cx + t * ux - y * uy, cy + t * uy + y * ux
    per = 1.0 / math.sqrt(1.0 + slope * slope)
    ux, uy = (ux - slope * uy) * per, (uy + slope * ux) * per
    out[2], out[3] = -uy, ux
    lever = 2.0 * t - s3 / s2
    out[4] = 1.0 / s2 + lever * lever / free
    out[5] = left
