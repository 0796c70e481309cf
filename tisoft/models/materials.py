"""What a body is made of: the parameters of each model, checked once, in SI units.

    λ = E ν / ((1 + ν)(1 − 2ν))      μ = E / (2 (1 + ν))
    E = μ (3λ + 2μ) / (λ + μ)        ν = λ / (2 (λ + μ))

| symbol | name                   | unit |
| ------ | ---------------------- | ---- |
| E, ν   | `young`, `poisson`     | Pa, 1 |
| λ, μ   | `lame_lambda`, `lame_mu` | Pa |
| φ, η   | `phi`, `eta`           | Pa·s, the Lamé constants of the strain rate |
| ζ      | `damping_ratio`        | 1, fraction of critical |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, keep_number, put
from tisoft.laws import LAWS
from tisoft.live import frozen

MassKind = Literal["lumped", "consistent"]

_INCOMPRESSIBLE = (
    "a body with 0.5 cannot change its volume, and linear tets lock before that: "
    "0.45 to 0.49 serves for rubber"
)


LIMITS: dict[str, dict[str, Any]] = {
    "young": {"above": 0.0, "unit": "Pa"},
    "poisson": {"above": -1.0, "below": 0.5, "remedy": _INCOMPRESSIBLE},
    "density": {"above": 0.0, "unit": "kg/m³"},
    "phi": {"unit": "Pa·s"},
    "eta": {"least": 0.0, "unit": "Pa·s"},
    "thickness": {"above": 0.0, "unit": "m"},
}
"""What a number of a material may be, as `checks.number` takes it."""


def lame_constants(young: float, poisson: float) -> tuple[float, float]:
    """λ and μ [Pa] of Young's modulus [Pa] and Poisson's ratio."""
    lam = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    return lam, young / (2.0 * (1.0 + poisson))


def young_and_poisson(lame_lambda: float, lame_mu: float) -> tuple[float, float]:
    """Young's modulus [Pa] and Poisson's ratio of λ and μ [Pa].

    Raises:
        FieldError: for constants of no stable material: μ > 0 and λ > −2μ/3 are needed, and
            λ so far above μ that Poisson's ratio rounds to 0.5 cannot be simulated.
    """
    mu = checks.number("lame_mu", lame_mu, above=0.0, unit="Pa")
    lam = checks.number("lame_lambda", lame_lambda, above=-2.0 * mu / 3.0, unit="Pa")
    ratio = lam / mu
    poisson = 0.5 * ratio / (1.0 + ratio) if ratio < 1e15 else 0.5
    if poisson >= 0.5:
        problem = f"is too far above lame_mu = {mu:g}: Poisson's ratio is 0.5; {_INCOMPRESSIBLE}"
        raise FieldError("lame_lambda", problem, lame_lambda)
    return 2.0 * mu * (1.0 + poisson), poisson


def _check_damping(model: SolidModel | MassSpring) -> None:
    """The fields that both families share: point damping and the damping ratio."""
    keep_number(model, "point_damping", least=0.0, unit="1/s")
    if model.damping_ratio is not None:
        keep_number(model, "damping_ratio", least=0.0)
    if model.damping_at is not None:
        keep_number(model, "damping_at", above=0.0, unit="Hz")
        if model.damping_ratio is None:
            raise FieldError("damping_at", "needs a damping_ratio beside it", model.damping_at)


@frozen
@dataclass(frozen=True)
class SolidModel:
    """Parameters that every model with tets has: an isotropic visco-elastic solid.

    Args:
        young: Young's modulus E [Pa].
        poisson: Poisson's ratio ν, above -1 and below 0.5.
        density: [kg/m³].
        phi: viscous counterpart of λ [Pa·s], at least −2η/3 (else viscosity would add energy).
        eta: viscous counterpart of μ [Pa·s] (ψ in O'Brien and Hodgins 1999).
        point_damping: force −point_damping·m·v on every node [1/s].
        mass: "lumped", or "consistent" where the model offers it.
        damping_ratio: instead of phi and eta: fraction of critical damping at `damping_at`; the
            simulation turns it into phi and eta in proportion to λ and μ.
        damping_at: [Hz]; left out, the body's first natural frequency.

    Raises:
        FieldError: naming the field, its value, the range and what to do.
    """

    young: float
    poisson: float
    density: float
    phi: float = 0.0
    eta: float = 0.0
    point_damping: float = 0.0
    mass: MassKind = "lumped"
    damping_ratio: float | None = None
    damping_at: float | None = None

    masses: ClassVar[tuple[MassKind, ...]] = ("lumped",)
    law: ClassVar[str]
    """Word of its stress law in `laws.LAWS`."""

    def __post_init__(self) -> None:
        for field in ("young", "poisson", "density", "eta"):
            keep_number(self, field, **LIMITS[field])
        least = -2.0 * self.eta / 3.0
        keep_number(self, "phi", least=least, unit="Pa·s", remedy="below it gives energy")
        _check_damping(self)
        checks.choice("mass", self.mass, ("lumped", "consistent"))
        if self.mass not in self.masses:
            problem = "works with the models linear and viscoelastic only; use lumped"
            raise FieldError("mass", problem, self.mass)
        if self.damping_ratio is not None and (self.phi or self.eta):
            raise FieldError("damping_ratio", "excludes phi and eta: it is turned into them")

    @classmethod
    def from_lame(
        cls, lame_lambda: float, lame_mu: float, density: float, **parameters: Any
    ) -> Self:
        """The same solid, from its Lamé constants λ and μ [Pa]."""
        young, poisson = young_and_poisson(lame_lambda, lame_mu)
        return cls(young, poisson, density, **parameters)

    @property
    def lame_lambda(self) -> float:
        """First Lamé constant λ [Pa]."""
        return lame_constants(self.young, self.poisson)[0]

    @property
    def lame_mu(self) -> float:
        """Second Lamé constant, the shear modulus μ [Pa]."""
        return lame_constants(self.young, self.poisson)[1]


@frozen
@dataclass(frozen=True)
class ViscoElastic(SolidModel):
    """St. Venant-Kirchhoff solid with viscosity (O'Brien and Hodgins 1999), for large
    displacements.
    """

    law = "viscoelastic"
    masses: ClassVar[tuple[MassKind, ...]] = ("lumped", "consistent")


@frozen
@dataclass(frozen=True)
class Linear(SolidModel):
    """Linear elasticity (Hooke 1678; Lamé 1852), for small displacements and rotations."""

    law = "linear"
    masses: ClassVar[tuple[MassKind, ...]] = ("lumped", "consistent")


@frozen
@dataclass(frozen=True)
class MassTensor(SolidModel):
    """Linear elasticity with its stiffness stored on nodes and edges (Cotin, Delingette and Ayache
    2000).
    """

    law = "linear"


@frozen
@dataclass(frozen=True)
class NeoHookean(SolidModel):
    """Stable neo-Hookean solid with viscosity (Smith, de Goes and Kim 2018): finds its way back
    from being turned inside out.
    """

    law = "neo-hookean"


@frozen
@dataclass(frozen=True, eq=False)
class MassSpring:
    """A network of springs between point masses (as of cloth, Provot 1995).

    Args:
        young: Young's modulus [Pa] that the springs stand for, where stiffness is "from-young".
        density: [kg/m³], of the volume of the tets, or of triangles times `thickness`.
        stiffness: "from-young", or [N/m]: one number, or one per spring.
        spring_damping: damper along each spring [N·s/m].
        point_damping: force −point_damping·m·v on every node [1/s].
        node_mass: instead of density [kg]: one number, or one per node.
        thickness: of a sheet of triangles [m], used with density.
        springs: "edges" (every edge of the mesh), or rows [i, j], [i, j, stiffness] or
            [i, j, stiffness, rest_length] with the file's node numbers.
        rest_lengths: [m], one per spring; left out, the lengths in the mesh.
        damping_ratio: instead of spring_damping: fraction of critical damping at `damping_at`.
        damping_at: [Hz]; left out, the body's first natural frequency.

    Once built, `springs` is "edges" or an int64 array (springs, 2); `stiffness` is "from-young",
    a number or an array (springs,); `rest_lengths` is None or an array (springs,). A NaN in these
    arrays stands for what the row left out: "from-young", and the length in the mesh.

    Raises:
        FieldError: naming the field, its value, the range and what to do.
    """

    young: float | None = None
    density: float | None = None
    stiffness: Any = "from-young"
    spring_damping: float = 0.0
    point_damping: float = 0.0
    node_mass: Any = None
    thickness: float | None = None
    springs: Any = "edges"
    rest_lengths: Any = None
    damping_ratio: float | None = None
    damping_at: float | None = None

    def __post_init__(self) -> None:
        for field in ("young", "density", "thickness"):
            if getattr(self, field) is not None:
                keep_number(self, field, **LIMITS[field])
        keep_number(self, "spring_damping", least=0.0, unit="N·s/m")
        _check_damping(self)
        if self.damping_ratio is not None and self.spring_damping:
            raise FieldError("damping_ratio", "excludes spring_damping: it is turned into it")
        _check_masses(self)
        _check_springs(self)
        for field in ("springs", "stiffness", "rest_lengths", "node_mass"):
            own = getattr(self, field)
            if isinstance(own, np.ndarray) and own.flags.writeable:
                put(self, field, own.copy())
                getattr(self, field).flags.writeable = False  # changes would not be noticed

    @property
    def needs_young(self) -> bool:
        """Whether some spring's stiffness comes from Young's modulus."""
        return bool(isinstance(self.stiffness, str) or np.isnan(self.stiffness).any())


def _check_masses(model: MassSpring) -> None:
    if model.node_mass is None and model.density is None:
        raise FieldError("density", "is missing; give it in kg/m³, or node_mass in kg")
    if model.node_mass is None:
        return
    if model.density is not None:
        raise FieldError("node_mass", "excludes density; give one of them", model.node_mass)
    put(model, "node_mass", _positive("node_mass", model.node_mass, "kg"))


def _check_springs(model: MassSpring) -> None:
    if isinstance(model.stiffness, str) or model.stiffness is None:
        checks.choice("stiffness", model.stiffness, ("from-young",))
    else:
        put(model, "stiffness", _positive("stiffness", model.stiffness, "N/m"))
    if model.rest_lengths is not None:
        lengths = checks.sequence("rest_lengths", model.rest_lengths, "numbers")
        put(model, "rest_lengths", _positive("rest_lengths", model.rest_lengths, "m", lengths))
    if isinstance(model.springs, str):
        checks.choice("springs", model.springs, ("edges",))
    else:
        _read_rows(model)
    if model.needs_young and model.young is None:
        problem = "is missing; give it in Pa (springs from-young), or stiffness in N/m"
        raise FieldError("young", problem)


def _read_rows(model: MassSpring) -> None:
    """Split rows [i, j, stiffness, rest_length] into the arrays of the fields."""
    if isinstance(model.springs, np.ndarray) and _are_pairs(model.springs):
        put(model, "springs", model.springs.astype(np.int64))
        return
    rows = checks.sequence("springs", model.springs, "rows [i, j]")
    pairs = np.zeros((len(rows), 2), dtype=np.int64)
    own = np.full((2, len(rows)), np.nan)  # stiffness and rest length of each row
    for n, row in enumerate(rows):
        field = f"springs[{n}]"
        items = checks.sequence(field, row, "i, j, stiffness, rest_length")
        if not 2 <= len(items) <= 4:
            problem = "must be [i, j], [i, j, stiffness] or [i, j, stiffness, rest_length]"
            raise FieldError(field, problem, row)
        pairs[n] = [checks.integer(f"{field}[{k}]", items[k]) for k in (0, 1)]
        if pairs[n, 0] == pairs[n, 1]:
            raise FieldError(field, "joins a node to itself; remove it", row)
        for k, unit in zip(range(2, len(items)), ("N/m", "m"), strict=False):
            own[k - 2, n] = checks.number(f"{field}[{k}]", items[k], above=0.0, unit=unit)
    put(model, "springs", pairs)
    for field, column in zip(("stiffness", "rest_lengths"), own, strict=True):
        if np.isfinite(column).any():
            _fill(model, field, column)


def _are_pairs(rows: NDArray[Any]) -> bool:
    """Whether an array needs no reading row by row: two different nodes each."""
    if rows.dtype.kind not in "iu" or rows.ndim != 2 or rows.shape[1] != 2:
        return False
    return bool((rows >= 0).all() and (rows[:, 0] != rows[:, 1]).all())


def _fill(model: MassSpring, field: str, column: NDArray[np.float64]) -> None:
    """Keep what the rows say; where they are silent, what the field says for all springs."""
    general = getattr(model, field)
    if isinstance(general, float):
        column = np.where(np.isnan(column), general, column)
    elif isinstance(general, np.ndarray):
        raise FieldError(field, "is given per spring and in the rows of springs; choose one")
    put(model, field, column)


def _positive(field: str, value: Any, unit: str, items: Any = None) -> Any:
    """A positive number, or an array of them (an array made by this class may hold NaN)."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.ndim == 1:
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero(~((value > 0.0) & (value < np.inf) | np.isnan(value)))
        if len(bad):
            problem = f"must be above 0 {unit} and finite"
            raise FieldError(f"{field}[{bad[0]}]", problem, value[bad[0]])
        return value
    if items is None and not isinstance(value, (list, tuple, np.ndarray)):
        return checks.number(field, value, above=0.0, unit=unit)
    return checks.array(field, value, lambda f, v: checks.number(f, v, above=0.0, unit=unit))


Model = SolidModel | MassSpring

MODELS: dict[str, type[SolidModel] | type[MassSpring]] = {
    "mass-spring": MassSpring,
    "mass-tensor": MassTensor,
    "linear": Linear,
    "viscoelastic": ViscoElastic,
    "neo-hookean": NeoHookean,
}
"""The models by their names in scene files."""


def model_of(word: str) -> type[SolidModel]:
    """A model for a law of `LAWS` that needs no parameters but those of every solid."""
    name = word.title().replace("-", "")
    base: type[SolidModel] = type(name, (SolidModel,), {"law": word, "__doc__": LAWS[word]})
    made = frozen(dataclass(frozen=True)(base))
    MODELS[word] = made
    return made


for _word in LAWS.keys() - MODELS.keys():
    model_of(_word)
