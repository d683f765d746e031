"""The image files of `deferred-ir render`: which frames go into which, and what they need of the graph."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import check_folder
from deferred_ir.cli.drawing import Picture
from deferred_ir.engine.setup import IMAGES, UNFILTERED
from deferred_ir.output.find_format import check_path, find_format
from deferred_ir.output.image import Image

_NUMBER = re.compile(r"%0\d{1,2}d")


class ImageFiles:
    """Writes pictures under `names`; a name with %04d gets every frame's, one without the last frame's.

    saved: frames written so far. black: whether all of them were.
    Raises OutputError, before there is anything to write, if a file or `json` cannot be written, or is named twice.
    """

    def __init__(self, names: Sequence[str], frames: int, json: Path | None = None) -> None:
        self.names, self._frames = names, frames
        self.saved, self.black = 0, bool(names)
        files = [_number(name, 0) for name in names]
        for file in files:
            check_path(file)
        if json:
            check_folder(json)
            files.append(json)
        places = [file.resolve() for file in files]
        for file, place in zip(files, places, strict=True):
            if places.count(place) > 1:
                raise OutputError(f"{file}: is named twice; give each output a file of its own")

    def choose_outputs(self, known: Mapping[str, str], *, averaged: bool, estimated: bool = False) -> list[str]:
        """Return the outputs of the graph, `known`, that the files need; all images if there are no files.

        Frames are `averaged` in radiance, whatever the files show; with their error `estimated`, in `unfiltered`, too.
        """
        names = {find_format(Path(name)).LAYER for name in self.names}
        missing = names - known.keys()
        if missing:
            which = f"'{min(missing)}', which these files need: {', '.join(self.names)}"
            raise OutputError(f"graph: has no output {which}; add it to [outputs]")
        if averaged and names:
            names.add("radiance")
        names = names or set(IMAGES)
        if estimated:
            names.add(UNFILTERED)
        return [name for name in known if name in names]

    def list_notes(self) -> Iterator[str]:
        """Yield which frames get lost."""
        for name in self.names if self._frames > 1 else ():
            if not _NUMBER.search(name):
                path = Path(name)
                yield f"{name} keeps the last of {self._frames} frames; {path.stem}_%04d{path.suffix} keeps all"

    def save(self, picture: Picture, read: Callable[[], Image]) -> None:
        """Write a picture under the names that it belongs to; `read` gets its image where it is still on the device."""
        last = picture.interrupted or picture.number == self._frames - 1
        names = [name for name in self.names if last or _NUMBER.search(name)]
        if not names:
            return
        image = picture.image or read()
        for name in names:
            image.save(_number(name, picture.number))
        self.saved = picture.number + 1
        self.black &= not any(pixels.any() for pixels in (image.radiance, image.display) if pixels is not None)

    def describe(self, frames: int) -> str:
        """Name the files that `frames` frames became."""
        first_and_last = (dict.fromkeys(str(_number(name, i)) for i in (0, frames - 1)) for name in self.names)
        return ", ".join(" to ".join(names) for names in first_and_last)


def _number(name: str, frame: int) -> Path:
    """Put the frame's number into a name."""
    return Path(_NUMBER.sub(lambda match: match[0] % frame, name))
