"""What a batch of strain windows said: the answer of `strain.read_strains`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.local_surface import LocalSurface
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_covariance import body_tensors, surface_covariance
from estimator.readers.strain_flags import FLAGS, nothing_to_fit
from estimator.vectors import Array, Mask


@dataclass(frozen=True, eq=False)
class StrainReadings:
    """What B windows of strains say. Arc coordinates: x along the finger, y = r theta around it.

    Args:
        array: Of which the strains are.
        states: x_0, y_0 [m], ln F, relative curvature K_xx, K_yy, K_xy [1/m], (B, 6).
        covariances: Of the states (B, 6, 6).
        ellipses: Contact ellipse matrices [m], (B, 2, 2).
        indentations: [m], (B,).
        residuals: Root mean square misfit over the stated noise [-], (B,).
        raised: Which of `strain_flags.FLAGS` each reading raises, (B, F).
        steps: Of the least squares (B,).
    """

    array: StrainArray
    states: Array
    covariances: Array
    ellipses: Array
    indentations: Array
    residuals: Array
    raised: Mask
    steps: Array

    def __len__(self) -> int:
        return len(self.states)

    @property
    def forces(self) -> Array:
        """[N], (B,); 0 without contact."""
        return np.where(nothing_to_fit(self.raised), 0.0, np.exp(self.states[:, 2]))

    @property
    def tensors(self) -> Array:
        """Curvature of the object along x and y, convex positive [1/m], (B, 2, 2)."""
        return body_tensors(self.states, self.array)

    @property
    def directions(self) -> Array:
        """psi of the object's flat direction from x, within 90 degrees either way [rad], (B,)."""
        K = self.tensors
        half, off = 0.5 * (K[:, 0, 0] - K[:, 1, 1]), K[:, 0, 1]
        return np.asarray(0.5 * np.arctan2(-off, -half))

    @property
    def direction_sd(self) -> Array:
        """Of psi to first order; trust it below 10 degrees [rad], (B,)."""
        K, psi = self.tensors, self.directions
        D = np.hypot(0.5 * (K[:, 0, 0] - K[:, 1, 1]), K[:, 0, 1])
        across = np.zeros((len(psi), 6))
        across[:, 3], across[:, 4] = 0.5 * np.sin(2 * psi), -0.5 * np.sin(2 * psi)
        across[:, 5] = -np.cos(2 * psi)
        variance = np.einsum("bi,bij,bj->b", across, self.covariances, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt(variance) / (2.0 * D))

    def flags(self, i: int) -> tuple[str, ...]:
        """Phrases of reading i."""
        return tuple(name for name, up in zip(FLAGS, self.raised[i], strict=True) if up)

    def surface(self, i: int) -> LocalSurface:
        """Reading i in the sensor's frame S: see `strain_array`."""
        state, pressed = self.states[i], float(self.indentations[i])
        angle, radius = state[1] * self.array.curvature, self.array.radius
        out = np.array([0.0, np.sin(angle), np.cos(angle)])
        x, around = np.array([1.0, 0.0, 0.0]), np.array([0.0, np.cos(angle), -np.sin(angle)])
        sagging = -2.0 * radius * np.sin(0.5 * angle) ** 2 if np.isfinite(radius) else 0.0
        arc = radius * np.sin(angle) if np.isfinite(radius) else state[1]
        K = self.tensors[i] * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return LocalSurface(
            position=np.array([state[0], arc, sagging]) - pressed * out,
            frame=np.stack([x, -around, -out]),
            tensor=K,
            covariance=surface_covariance(
                self.covariances[i], self.ellipses[i], pressed, self.array
            ),
            force=float(self.forces[i]),
            residual=float(self.residuals[i]),
            flags=self.flags(i),
        )
