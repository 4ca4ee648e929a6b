"""How a gel lies on a body: its shape inside the contact ellipse, Hertz's free surface outside.

Inside, the gel takes the body's true shape. Outside, the displacement of the half space under the
Hertz pressure is exact (Johnson, Contact Mechanics, eq. 3.42),

    u = 3F / (4 pi E*) (I - x^2 I_a - y^2 I_b),   I   = 2 R_F(s, a^2 + s, b^2 + s),
    I_a = 2/3 R_D(s, b^2 + s, a^2 + s),           I_b = 2/3 R_D(s, a^2 + s, b^2 + s)

with s the root of x^2/(a^2 + s) + y^2/(b^2 + s) = 1, tabulated for each touch over
t = sqrt(s) / (sqrt(s) + sqrt(a b)). Two approximations: a
finite thickness h damps it by (1 + distance / 8h)^-8, nearly an exponential, and a body that is no
paraboloid scales it along each ray so that the gel meets the body at the rim of the ellipse.
Lengths here in millimetres.
"""

from __future__ import annotations

import numpy as np
from scipy.special import elliprd, elliprf

from estimator.compiled import compiled, compiled_part
from estimator.readers.depth_fit import dome
from estimator.vectors import Array

NODES = 21
_LAST = 0.97  # of t


def free_surface(a: Array, b: Array, delta: Array) -> Array:
    """u / delta as cubics between nodes of t: of its three integrals, (B, NODES - 1, 3, 4)."""
    t = np.linspace(0.0, _LAST, NODES)
    c = np.sqrt(a * b)[:, None]
    root = c * t / (1.0 - t)
    s = root**2
    A, B = a[:, None] ** 2 + s, b[:, None] ** 2 + s
    whole = 2.0 * elliprf(0.0, a**2, b**2)[:, None]
    slope = -2.0 * c / (1.0 - t) ** 2 / np.sqrt(A * B) / whole * t[1]
    f = np.stack([2.0 * elliprf(s, A, B), elliprd(s, B, A) / 1.5, elliprd(s, A, B) / 1.5], axis=-1)
    f /= whole[..., None]
    d = np.stack([slope, slope / A, slope / B], axis=-1)
    f0, d0, rise, d1 = f[:, :-1], d[:, :-1], np.diff(f, axis=1), d[:, 1:]
    return np.stack([f0, d0, 3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise], axis=-1)


@compiled
def outside(x: float, y: float, a: float, b: float, root_ab: float, table: Array) -> float:
    """u / delta outside the ellipse, x along a; root_ab = sqrt(a b)."""
    x2, y2, a2, b2 = x * x, y * y, a * a, b * b
    half = 0.5 * (x2 + y2 - a2 - b2)
    s = half + (half * half + x2 * b2 + y2 * a2 - a2 * b2) ** 0.5
    root = max(s, 0.0) ** 0.5
    t = min(root / (root + root_ab), _LAST * 0.999999) * ((NODES - 1) / _LAST)
    i = int(t)
    t -= i
    p = table[i]
    whole = p[0, 0] + t * (p[0, 1] + t * (p[0, 2] + t * p[0, 3]))
    along = p[1, 0] + t * (p[1, 1] + t * (p[1, 2] + t * p[1, 3]))
    across = p[2, 0] + t * (p[2, 1] + t * (p[2, 2] + t * p[2, 3]))
    return float(whole - x2 * along - y2 * across)


@compiled_part
def height(x: float, y: float, c: Array) -> float:
    """Polynomial of `gel_shape.POWERS`."""
    second = c[0] * x * x + c[1] * x * y + c[2] * y * y
    third = x * x * (c[3] * x + c[4] * y) + y * y * (c[5] * x + c[6] * y)
    fourth = x * x * (c[7] * x * x + c[8] * x * y + c[9] * y * y)
    return float(second + third + fourth + y * y * y * (c[10] * x + c[11] * y))


@compiled
def press_into(
    out: Array,
    pitch: float,
    radius: float,
    thickness: float,
    ats: Array,
    bodies: Array,
    shapes: Array,
    tables: Array,
) -> None:
    """Depth images of B touches.

    Args:
        out: (B, H, W) [mm].
        pitch, radius, thickness: [mm]; the last two may be inf.
        ats: Where on the undeformed pad the body's place comes to lie, x and y [mm], (B, 2).
        bodies: Heights under the tangent plane in the pad's axes [mm], (B, 12).
        shapes: cos, sin of a's direction, a, b, delta, and curvatures of the pressed paraboloid
            along a and b, (B, 7).
        tables: Of `free_surface`.
    """
    rows, columns = out.shape[1:]
    flat, eighth = not np.isfinite(radius), 0.125 / thickness
    for n in range(out.shape[0]):
        x0, y0 = ats[n]
        c, s, a, b, delta, ka, kb = shapes[n]
        body, table = bodies[n], tables[n]
        z0, root_ab, inv_a, inv_b = dome(x0, y0, radius), (a * b) ** 0.5, 1.0 / a, 1.0 / b
        bend = 0.0 if flat else 0.5 / radius
        # axes of the tangent plane at the place, in the pad's: e1, e2, e3 outwards
        e3x, e3y = (0.0, 0.0) if flat else (x0 / radius, y0 / radius)
        e3z = (1.0 - e3x * e3x - e3y * e3y) ** 0.5
        e1z = -e3x / (e3z * e3z + e3x * e3x) ** 0.5
        e1x = (1.0 - e1z * e1z) ** 0.5
        e2x, e2y, e2z = e3y * e1z, e3z * e1x - e3x * e1z, -e3y * e1x
        for i in range(rows):
            y = (i - 0.5 * (rows - 1)) * pitch
            q = y - y0  # `height` along this row of a flat pad, a polynomial of p
            h0 = q * q * (body[2] + q * (body[6] + q * body[11]))
            h1 = q * (body[1] + q * (body[5] + q * body[10]))
            h2, h3 = body[0] + q * (body[4] + q * body[9]), body[3] + q * body[8]
            for j in range(columns):
                x = (j - 0.5 * (columns - 1)) * pitch
                pad = dome(x, y, radius)
                dx, dy, dz = x - x0, y - y0, pad - z0
                p, q = e1x * dx + e1z * dz, e2x * dx + e2y * dy + e2z * dz
                u, v = c * p + s * q, c * q - s * p
                far = (u * inv_a) ** 2 + (v * inv_b) ** 2
                if far > 1.0:
                    near = 1.0 / far**0.5
                    rim_p, rim_q, rim_u, rim_v = p * near, q * near, u * near, v * near
                    drop = height(rim_p, rim_q, body) + bend * (rim_p * rim_p + rim_q * rim_q)
                    meant = delta - 0.5 * (ka * rim_u * rim_u + kb * rim_v * rim_v)
                    gap = (u * u + v * v) ** 0.5 * (1.0 - near)
                    damp = (1.0 + gap * eighth) ** 2
                    damp *= damp
                    relaxed = delta * outside(u, v, a, b, root_ab, table)
                    out[n, i, j] = relaxed * max(delta - drop, 0.0) / (meant * damp * damp)
                elif flat:
                    drop = h0 + p * (h1 + p * (h2 + p * (h3 + p * body[7])))
                    out[n, i, j] = max(delta - drop, 0.0)
                else:
                    h = 0.0
                    for _ in range(4):  # the body's surface under this pixel
                        p, q = e1x * dx + e1z * dz, e2x * dx + e2y * dy + e2z * dz
                        h = e3x * dx + e3y * dy + e3z * dz + delta - height(p, q, body)
                        dz -= h / e3z
                    out[n, i, j] = max(pad - z0 - dz, 0.0)
