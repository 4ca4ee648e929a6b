"""The quadratic under a depth image, fitted where the gel certainly lies on the object.

Outside the contact the gel is free, and a fit that reaches there sees a flatter and turned body;
no threshold of depth keeps it out of line contacts (sensor.md, section 4). So the domain follows
the fit: from the fitted relative curvatures and depth Hertz gives the contact ellipse,

    b^2 = 2 delta (E/K) / (kappa_a + kappa_b),    a/b = t^-0.636,   t = kappa_a / kappa_b

(complete elliptic integrals E/K by Hamrock & Brewe's fit, 3 %: a domain needs no more), and the
next fit uses |v| < 0.85 b across and nothing beyond 0.95 of the ellipse. That is for a half space;
a bonded layer is in contact farther out than its depth says: the domain errs to the safe side.

Along a principal direction bodies are rather arcs than parabolas. To fourth order a sphere and a
cylinder of any radius are z = q + 1/2 (g.x) x'H^2x + 1/4 q x'H^2x, q = 1/2 x'Hx; the two last terms
are taken from the fit before and subtracted. Lengths in millimetres.
"""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readers.depth_cells import COUNT, MEAN, X, Y
from estimator.vectors import Array, Mask

TERMS = 6  # c, g_x, g_y, H_xx, H_xy, H_yy
FEWEST_CELLS = 12
ACROSS, WITHIN = 0.85, 0.95
_FLATTEST = 1.0 / 400.0  # of kappa_a / kappa_b, for the length of a line contact
ROUNDS = 6


@compiled_part
def dome(x: float, y: float, radius: float) -> float:
    """Height of the undeformed pad over its apex [mm]; falls away from it."""
    if not np.isfinite(radius):
        return 0.0
    r2 = x * x + y * y
    return -r2 / float(radius + max(radius * radius - r2, 0.0) ** 0.5)


@compiled
def dome_terms(x: float, y: float, radius: float, terms: Array) -> None:
    """Taylor terms of the undeformed pad at x, y."""
    terms[:] = 0.0
    if np.isfinite(radius):
        s = max(radius * radius - x * x - y * y, 0.01 * radius * radius) ** 0.5
        terms[0] = dome(x, y, radius)
        terms[1], terms[2] = -x / s, -y / s
        terms[3] = -1.0 / s - x * x / s**3
        terms[4] = -x * y / s**3
        terms[5] = -1.0 / s - y * y / s**3


@compiled_part
def beyond_quadratic(x: float, y: float, t: Array) -> float:
    """Third and fourth order of a body whose sections are arcs."""
    hx, hy = t[3] * x + t[4] * y, t[4] * x + t[5] * y
    bend = hx * hx + hy * hy
    q = 0.5 * (x * hx + y * hy)
    return float(0.5 * bend * (t[1] * x + t[2] * y + 0.5 * q))


@compiled_part
def row_of(x: float, y: float, row: Array) -> None:
    row[0], row[1], row[2] = 1.0, x, y
    row[3], row[4], row[5] = 0.5 * x * x, x * y, 0.5 * y * y


@compiled_part
def inverse(A: Array, out: Array) -> bool:
    """Inverse of a small symmetric matrix by Cholesky; False where it is not positive."""
    n = A.shape[0]
    L = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if not s > 1e-12 * A[i, i]:
                    return False
                L[i, i] = s**0.5
            else:
                L[i, j] = s / L[j, j]
    R = np.zeros((n, n))  # inverse of L
    for i in range(n):
        R[i, i] = 1.0 / L[i, i]
        for j in range(i):
            s = 0.0
            for k in range(j, i):
                s -= L[i, k] * R[k, j]
            R[i, j] = s / L[i, i]
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(max(i, j), n):
                s += R[k, i] * R[k, j]
            out[i, j] = s
    return True


@compiled
def gather(cells: Array, inside: Mask, radius: float, points: Array, centre: Array) -> int:
    """The domain as a list, and its middle; how many cells it has.

    Args:
        cells: Of `pool`, (4, h, w).
        inside: The domain, (h, w).
        radius: Of the undeformed pad [mm], inf for a flat one.
        points: Out: x, y, height of the body, pixels; (4, h w) of which the first are set.
        centre: Out: (2,) [mm].
    """
    n, weight, sx, sy = 0, 0.0, 0.0, 0.0
    for i in range(inside.shape[0]):
        for j in range(inside.shape[1]):
            if inside[i, j]:
                x, y, w = cells[X, i, j], cells[Y, i, j], cells[COUNT, i, j]
                points[0, n], points[1, n], points[3, n] = x, y, w
                points[2, n] = dome(x, y, radius) - cells[MEAN, i, j]
                sx, sy, weight = sx + w * x, sy + w * y, weight + w
                n += 1
    if n:
        centre[0], centre[1] = sx / weight, sy / weight
    return n


@compiled
def fit_once(points: Array, n: int, centre: Array, terms: Array, inv: Array) -> bool:
    """Least squares over the domain, about its middle; False where that has no solution.

    Args:
        points, n, centre: Of `gather`.
        terms: In: of the fit before, about nearly the same point. Out: c, g, H of the *object's*
            height z(x) over the image plane [mm], [-], [1/mm].
        inv: Out: inverse normal matrix, (6, 6), pixels as weights.
    """
    px, py, pz, pw = points[0, :n], points[1, :n], points[2, :n], points[3, :n]
    g0, g1, h0, h1, h2 = terms[1], terms[2], terms[3], terms[4], terms[5]
    w0 = wx = wy = xx = xy = yy = 0.0  # moments, named by their powers
    x3 = x2y = xy2 = y3 = x4 = x3y = x2y2 = xy3 = y4 = 0.0
    z0 = zx = zy = zxx = zxy = zyy = 0.0
    for i in range(n):
        x, y, w = px[i] - centre[0], py[i] - centre[1], pw[i]
        hx, hy = h0 * x + h1 * y, h1 * x + h2 * y
        beyond = 0.5 * (hx * hx + hy * hy) * (g0 * x + g1 * y + 0.25 * (x * hx + y * hy))
        z = w * (pz[i] - beyond)
        a, b, c = x * x, x * y, y * y
        wa, wb, wc = w * a, w * b, w * c
        w0, wx, wy, xx, xy, yy = w0 + w, wx + w * x, wy + w * y, xx + wa, xy + wb, yy + wc
        x3, x2y, xy2, y3 = x3 + wa * x, x2y + wa * y, xy2 + wc * x, y3 + wc * y
        x4, x3y, x2y2, xy3, y4 = x4 + wa * a, x3y + wa * b, x2y2 + wa * c, xy3 + wc * b, y4 + wc * c
        z0, zx, zy = z0 + z, zx + z * x, zy + z * y
        zxx, zxy, zyy = zxx + z * a, zxy + z * b, zyy + z * c
    A = np.array(
        (
            (w0, wx, wy, 0.5 * xx, xy, 0.5 * yy),
            (wx, xx, xy, 0.5 * x3, x2y, 0.5 * xy2),
            (wy, xy, yy, 0.5 * x2y, xy2, 0.5 * y3),
            (0.5 * xx, 0.5 * x3, 0.5 * x2y, 0.25 * x4, 0.5 * x3y, 0.25 * x2y2),
            (xy, x2y, xy2, 0.5 * x3y, x2y2, 0.5 * xy3),
            (0.5 * yy, 0.5 * xy2, 0.5 * y3, 0.25 * x2y2, 0.5 * xy3, 0.25 * y4),
        )
    )
    if not inverse(A, inv):
        return False
    for k in range(TERMS):
        lower = inv[k, 0] * z0 + inv[k, 1] * zx + inv[k, 2] * zy
        terms[k] = lower + 0.5 * inv[k, 3] * zxx + inv[k, 4] * zxy + 0.5 * inv[k, 5] * zyy
    return True


@compiled_part
def semi_axes(along: float, across: float, delta: float, longest: float) -> tuple[float, float]:
    """a, b of the contact; one that outgrows the pad is as long as that, and as deep."""
    t, a, b = min(max(along / across, _FLATTEST), 1.0), 0.0, 0.0
    for _ in range(3):
        ratio = (1.0003 + 0.5968 * t) / (1.5277 - 0.6023 * np.log(t))
        b = (2.0 * delta * ratio / (across * (1.0 + t))) ** 0.5
        a = max(t**-0.636, 1.0) * b
        if a <= longest:
            break
        t, a = min(max(t, (longest / b) ** -1.572), 1.0), longest
    return a, min(a, b)


@compiled_part
def ellipse_of(terms: Array, radius: float, centre: Array, longest: float, ellipse: Array) -> bool:
    """Write (x, y, cos, sin, a, b, delta) of the Hertz ellipse; False where the fit is not convex.

    The direction is that of a; x, y is the deepest point, found no farther than half of a or b.
    """
    pad = np.empty(TERMS)
    dome_terms(centre[0], centre[1], radius, pad)
    depth, gx, gy = pad[0] - terms[0], pad[1] - terms[1], pad[2] - terms[2]
    xx, xy, yy = terms[3] - pad[3], terms[4] - pad[4], terms[5] - pad[5]
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    D = (half * half + xy * xy) ** 0.5
    across, along = mean + D, mean - D
    if not (across > 0.0 and depth > 0.0):
        return False
    angle = 0.5 * np.arctan2(-xy, -half)  # of the flatter direction
    c, s = np.cos(angle), np.sin(angle)
    gu, gv, soft = c * gx + s * gy, -s * gx + c * gy, max(along, _FLATTEST * across)
    a, b = semi_axes(along, across, depth, longest)
    half = 0.5 * a if a < longest else 0.0  # a line has no deepest point
    u = min(max(gu / soft, -half), half)
    v = min(max(gv / across, -0.5 * b), 0.5 * b)
    delta = depth + gu * u + gv * v - 0.5 * (soft * u * u + across * v * v)
    ellipse[0], ellipse[1] = centre[0] + c * u - s * v, centre[1] + s * u + c * v
    ellipse[2], ellipse[3], ellipse[6] = c, s, max(delta, depth)
    ellipse[4], ellipse[5] = semi_axes(along, across, ellipse[6], longest)
    return True


@compiled_part
def domain(
    cells: Array, ellipse: Array, radius: float, inside: Mask, points: Array, centre: Array
) -> int:
    """Mark and `gather` the cells well inside the ellipse, never less than 0.3 of its depth."""
    inside[:] = False
    x0, y0, c, s, a, b = ellipse[0], ellipse[1], ellipse[2], ellipse[3], ellipse[4], ellipse[5]
    wide = WITHIN * np.hypot(a * c, b * s)
    n, weight, sx, sy = 0, 0.0, 0.0, 0.0
    for i in range(inside.shape[0]):
        for j in range(inside.shape[1]):
            x, y, w = cells[X, i, j], cells[Y, i, j], cells[COUNT, i, j]
            if abs(x - x0) > wide or w == 0.0 or cells[MEAN, i, j] < 0.3 * ellipse[6]:
                continue
            u, v = (c * (x - x0) + s * (y - y0)) / a, (c * (y - y0) - s * (x - x0)) / b
            if abs(v) < ACROSS and u * u + v * v < WITHIN * WITHIN:
                inside[i, j] = True
                points[0, n], points[1, n], points[3, n] = x, y, w
                points[2, n] = dome(x, y, radius) - cells[MEAN, i, j]
                sx, sy, weight = sx + w * x, sy + w * y, weight + w
                n += 1
    if n:
        centre[0], centre[1] = sx / weight, sy / weight
    return n
