"""Named materials: numbers to start from, each with its source.

Soft materials vary: of one kind of rubber, gel or tissue, samples differ by factors of two and
more.  Poisson's ratio of rubbers, gels and tissues is 0.499 and above when measured (they keep
their volume); the values here are lower because linear tets lock there.  A damping ratio is half
the loss factor of the material, as at resonance.
"""

from __future__ import annotations

from dataclasses import dataclass

from tisoft.checks import choice


@dataclass(frozen=True)
class Preset:
    """A named material: `young` [Pa], `poisson`, `density` [kg/m³], `damping_ratio`, `source`."""

    young: float
    poisson: float
    density: float
    damping_ratio: float
    source: str

    def parameters(self) -> dict[str, float]:
        """The numbers by the names that models take, as ViscoElastic(**preset.parameters())."""
        return {
            "young": self.young,
            "poisson": self.poisson,
            "density": self.density,
            "damping_ratio": self.damping_ratio,
        }


PRESETS: dict[str, Preset] = {
    "rubber": Preset(
        1.5e6,
        0.47,
        950.0,
        0.05,
        "vulcanised natural rubber: density and shear modulus 0.5 MPa (a third of Young's), "
        "MatWeb data sheet; damping: loss factor about 0.1, Gent, Engineering with Rubber, 2012",
    ),
    "silicone": Preset(
        1.3e6,
        0.47,
        1030.0,
        0.05,
        "Sylgard 184, 10:1, cured at 25 °C: Young, Johnston et al. 2014; density, Dow data sheet; "
        "damping: round value for a lightly filled elastomer, no measurement",
    ),
    "jelly": Preset(
        4.3e3,
        0.45,
        1010.0,
        0.05,
        "gelatin gel, 20 parts of water to 1: Young 4.34 kPa, Bonavia 2025 (arXiv:2512.20502); "
        "density: water with 5 % gelatin; damping: loss factor 0.06 to 0.14 of a soft gel at "
        "20 to 200 Hz, Okamoto, Clayton and Bayly 2011",
    ),
    "muscle": Preset(
        62e3,
        0.45,
        1060.0,
        0.1,
        "relaxed gluteal muscle under a light load: Young 62 kPa, Isogai et al. 2022; density, "
        "Mendez and Keys 1960; damping: round value near that of liver, no measurement",
    ),
    "fat": Preset(
        26e3,
        0.45,
        950.0,
        0.1,
        "gluteal subcutaneous tissue under a light load: Young 26 kPa, Isogai et al. 2022; "
        "density, Goss et al. 1978; damping: round value near that of liver, no measurement",
    ),
    "liver": Preset(
        5.4e3,
        0.45,
        1060.0,
        0.12,
        "shear modulus 1.8 kPa (a third of Young's), Palmeri et al. 2008; density, Duck 2013; "
        "damping: loss factor tan(0.15 π/2) at 40 to 100 Hz, Sinkus et al. 2006",
    ),
    "foam": Preset(
        5e5,
        0.3,
        30.0,
        0.1,
        "flexible polymer foam of very low density: Young 0.3 to 1 MPa, density 16 to 35 kg/m³, "
        "Ashby, Materials Selection in Mechanical Design, 2011; Poisson, Gibson and Ashby, "
        "Cellular Solids, 1997; damping: round value, no measurement",
    ),
}


def preset(name: str) -> Preset:
    """The preset of this name; raises FieldError (field "material") where there is none."""
    return PRESETS[choice("material", name, list(PRESETS))]
