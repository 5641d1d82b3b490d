"""Maps as ROS's map_server and Nav2 load them: a grey picture and a YAML file beside it.

In the ``trinary`` mode a pixel ``v`` reads as (255 - v) / 255: over ``occupied_thresh`` occupied, under
``free_thresh`` free, else unknown. Unknown cells are 205, which reads as 0.19608, so ``free_thresh`` must be
0.196: with Nav2's own default of 0.25 unknown cells would load as free.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.mapping.occupancy import OccupancyGrid

OCCUPIED_PIXEL, UNKNOWN_PIXEL, FREE_PIXEL = 0, 205, 254
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196


CERTAIN = math.log(0.99 / 0.01)
"""Log odds of an occupied cell that was read; a free one has it negative, an unknown one zero."""


def write_rosmap(
    stem: Path | str, grid: OccupancyGrid, *, occupied: float = 0.65, free: float = 0.35
) -> Path:
    """Write ``<stem>.pgm`` and ``<stem>.yaml``.

    Parameters
    ----------
    stem : path
        The two files without their suffixes.
    grid : OccupancyGrid
        Its cells with a probability over ``occupied`` become black, under ``free`` white, others unknown.

    Returns
    -------
    Path
        The YAML file.

    Raises
    ------
    DataError
        The files cannot be written.
    """
    stem = Path(stem)
    picture, description = stem.with_name(stem.name + ".pgm"), stem.with_name(stem.name + ".yaml")
    probability = grid.probability
    pixels = np.full(grid.shape, UNKNOWN_PIXEL, dtype=np.uint8)
    pixels[probability > occupied] = OCCUPIED_PIXEL
    pixels[probability < free] = FREE_PIXEL
    rows, columns = grid.shape
    with atomic_path(picture) as temporary:
        # A picture's first row is its top, the grid's its bottom.
        temporary.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + np.flipud(pixels).tobytes())
    settings = {
        "image": picture.name,
        "mode": "trinary",
        "resolution": float(grid.resolution),
        "origin": [round(float(grid.origin[0]), 9), round(float(grid.origin[1]), 9), 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESHOLD,
        "free_thresh": FREE_THRESHOLD,
    }
    with atomic_path(description) as temporary:
        temporary.write_text(
            yaml.safe_dump(settings, sort_keys=False, default_flow_style=None), encoding="utf-8"
        )
    return description


def read_rosmap(path: Path | str) -> OccupancyGrid:
    """Read a map by its YAML file (or the path without the suffix), in the ``trinary`` mode.

    Returns
    -------
    OccupancyGrid
        Each cell is occupied or free with log odds of `CERTAIN`, or unknown.

    Raises
    ------
    DataError
        A file is not there, is no map, or has a picture that is not a binary 8-bit PGM.
    """
    path = Path(path)
    if path.suffix != ".yaml":
        path = path.with_name(path.name + ".yaml")
    try:
        settings = yaml.safe_load(path.read_text(encoding="utf-8"))
        resolution = float(settings["resolution"])
        origin = np.array(settings["origin"][:2], dtype=np.float64)
        occupied, free = float(settings["occupied_thresh"]), float(settings["free_thresh"])
        negate = bool(settings["negate"])
        picture = path.parent / settings["image"]
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise DataError(
            f"{path}: expected the settings of a ROS map, found none or a bad one ({' '.join(str(error).split())})"
        ) from error
    if not (resolution > 0.0 and origin.shape == (2,) and np.isfinite(origin).all()):
        raise DataError(f"{path}: resolution must be positive and origin three finite numbers")
    shade = _read_pgm(picture).astype(np.float64)[::-1] / 255.0
    occupancy = shade if negate else 1.0 - shade
    log_odds = np.zeros(shade.shape, dtype=np.float32)
    log_odds[occupancy > occupied] = CERTAIN
    log_odds[occupancy < free] = -CERTAIN
    return OccupancyGrid(origin, resolution, log_odds)


def _read_pgm(path: Path) -> NDArray[np.uint8]:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path, formats=["PPM"]) as picture:
            pixels = np.asarray(picture)
    except (UnidentifiedImageError, ValueError, SyntaxError, EOFError) as error:
        raise DataError(
            f"{path}: expected a binary PGM picture of 8 bits, found something else ({error})"
        ) from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    if pixels.ndim != 2 or pixels.dtype != np.uint8:
        raise DataError(
            f"{path}: expected one channel of 8 bits, found {pixels.dtype} of shape {pixels.shape}"
        )
    return pixels
