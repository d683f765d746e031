"""Reads MTL files: colours and emission, and the keys of metal and gloss that exporters added (Pr, Pm, norm)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deferred_ir.loading.asset_paths import strip_options
from deferred_ir.scene.surfaces.materials import IDENTITY, Affine, Sampler, TextureRef

GLOSS = ("pr", "pm", "map_pr", "map_pm")
"""Keys that only a material with gloss has."""
NOT_HONOURED = {
    name.lower(): name
    for name in (
        *("Ks", "Ns", "map_Ks", "map_Ns", "Ps", "map_Ps", "Pc", "Pcr", "aniso", "anisor", "refl"),
        *("bump", "map_Bump", "disp", "decal"),
    )
}
"""Keys whose absence from the picture is told, by themselves in small letters."""


@dataclass(frozen=True)
class MtlMaterial:
    """A material's lines: the text after each key, by the key in small letters; of two with one key the later."""

    lines: Mapping[str, str]

    def read_numbers(self, key: str) -> tuple[float, ...]:
        """Return the numbers of a line before its comment; none for anything else, such as `spectral file.rfl`."""
        try:
            return tuple(float(word) for word in self.lines.get(key, "").partition("#")[0].split())
        except ValueError:
            return ()

    def read_number(self, key: str) -> float | None:
        """Return the first number of a line, None if there is none."""
        numbers = self.read_numbers(key)
        return numbers[0] if numbers else None

    def find_file(self, key: str) -> str | None:
        """Return the file that a map names, None if there is none."""
        return strip_options(self.lines.get(key, "")).strip() or None

    def read_options(self, key: str) -> dict[str, list[str]]:
        """Return the options before a map's file name: what follows each, such as {"-s": ["2", "2", "1"]}."""
        line = self.lines.get(key, "").strip()
        before = line.removesuffix(strip_options(line))
        options: dict[str, list[str]] = {}
        for word in before.split():
            if word.startswith("-") and word[1:2].isalpha():
                options[word.lower()] = []
            elif options:
                options[next(reversed(options))].append(word)
        return options

    def read_use(self, key: str) -> TextureRef:
        """Return how a map is read: its options scale (-s), move (-o) and clamp (-clamp on) it."""
        options = self.read_options(key)
        (across, up), (right, above) = _read_pair(options, "-s", 1.0), _read_pair(options, "-o", 0.0)
        transform: Affine = (across, 0.0, right, 0.0, up, above)
        clamps = options.get("-clamp", ["off"])[:1] == ["on"]
        sampler = Sampler(("clamp", "clamp")) if clamps else Sampler()
        return TextureRef(0, 0, IDENTITY if transform == IDENTITY else transform, sampler)

    @property
    def is_glossy(self) -> bool:
        """Whether it has keys of metal or gloss."""
        return any(key in self.lines for key in GLOSS)

    @property
    def transparency(self) -> list[str]:
        """The keys by which it asks to be transparent."""
        coverage, transmission = (self.read_number(key) for key in ("d", "tr"))
        asked = ["d"] if coverage is not None and coverage < 1 else []
        asked += ["Tr"] if transmission and coverage is None else []
        return asked + (["map_d"] if self.find_file("map_d") else [])

    @property
    def not_honoured(self) -> list[str]:
        """The keys that would change the picture and are not read."""
        keys = [key for key in NOT_HONOURED if self.lines.get(key, "").strip() and any(self.read_numbers(key) or [1])]
        # Ns says how Ks is spread.
        return [NOT_HONOURED[key] for key in keys if key != "ns" or "ks" in keys]


def read_materials(mtl: str) -> dict[str, MtlMaterial]:
    """Read the materials of an MTL text by name; of two with the same name the later counts."""
    materials: dict[str, dict[str, str]] = {}
    name = ""
    for line in mtl.splitlines():
        key, *rest = line.split(maxsplit=1) or [""]
        key, value = key.lower(), rest[0] if rest else ""
        if key == "newmtl":
            name = " ".join(value.split())
            materials[name] = {}
        elif name and value.strip() and not key.startswith("#"):
            materials[name][key] = value
    return {name: MtlMaterial(lines) for name, lines in materials.items()}


def describe_losses(materials: Iterable[MtlMaterial]) -> list[str]:
    """Say what of materials is not honoured, each in one line."""
    used = list(materials)
    transparency = dict.fromkeys(key for material in used for key in material.transparency)
    others = dict.fromkeys(key for material in used for key in material.not_honoured)
    notes = [f"transparency is ignored ({', '.join(sorted(transparency))})"] if transparency else []
    return notes + ([f"not honoured: {', '.join(sorted(others))}"] if others else [])


def _read_pair(options: Mapping[str, list[str]], key: str, missing: float) -> tuple[float, float]:
    """Return the first two numbers of an option."""
    numbers = [missing if (number := _parse(word)) is None else number for word in options.get(key, [])]
    first, second, *_ = [*numbers, missing, missing]
    return first, second


def _parse(word: str) -> float | None:
    """Return a finite number, None for another word."""
    try:
        number = float(word)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
