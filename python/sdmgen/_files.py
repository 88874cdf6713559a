"""Files: images, level sets, meshes and models."""

from __future__ import annotations

import ctypes
import os
from ctypes import byref
from typing import Any, Mapping, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _abi
from ._arrays import address, copied, flag, number, path_bytes, text_bytes
from ._errors import UnsupportedError, argument_error
from ._grid import Grid
from ._library import Callbacks, array, call, function, make
from ._map import Band, Image, Map, Segment
from ._mesh import Mesh
from ._model import Model

IMAGES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
WRITTEN_IMAGES = (".nii", ".nii.gz", ".nrrd", ".mha")
MESHES = (".ply", ".stl", ".obj", ".off", ".vtk", ".vtp")
_TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64")


def _ends(path: Any, endings: tuple[str, ...]) -> bool:
    return os.fsdecode(path_bytes(path)).endswith(endings)


def read(path: Any) -> Union[Image, Mesh, Model, NDArray[Any]]:
    """Reads a file by the ending of its name: an image or segmentation (.nii .nii.gz .nrrd .nhdr .mha
    .mhd) as an Image of float32, a mesh (.ply .stl .obj .off .vtk .vtp), a model (.sdm), or an array (.npy)."""
    if _ends(path, IMAGES):
        return read_image(path)
    if _ends(path, MESHES):
        return Mesh.read(path)
    if _ends(path, (".sdm",)):
        return Model(path)
    if _ends(path, (".npy",)):
        return read_array(path)
    known = " ".join((*IMAGES, *MESHES, ".sdm", ".npy"))
    raise UnsupportedError("unsupported", f"{os.fspath(path)!r}: the name must end in one of {known}")


def read_array(path: Any) -> NDArray[Any]:
    values, shape, dims = ctypes.c_void_p(), (ctypes.c_size_t * 4)(), ctypes.c_int()
    call("sdm_npy_read", path_bytes(path), byref(values), shape, byref(dims))
    try:
        return copied(values.value, tuple(shape)[: dims.value], np.float64)
    finally:
        function("sdm_free")(values)


def read_image(path: Any) -> Image:
    """Reads an image or a segmentation; its values become float32."""
    volume = make("sdm_volume")
    call("sdm_volume_read", path_bytes(path), byref(volume))
    try:
        grid = Grid._of(volume.grid)
        shape = grid.shape if volume.n_layers == 1 else (volume.n_layers, *grid.shape)
        image = Image(copied(volume.values, shape, np.float32), grid, volume.text.decode("utf-8", "replace"))
        image.placed = volume.placed
        if volume.n_segments:
            segments = (_abi.structs["sdm_segment"] * volume.n_segments).from_address(volume.segments)
            texts = [(s.name.decode("utf-8", "replace"), s.id.decode("utf-8", "replace")) for s in segments]
            image.segments = tuple(Segment(*t, s.value, s.layer) for t, s in zip(texts, segments))
        return image
    finally:
        function("sdm_volume_dispose")(byref(volume))


def write(
    path: Any,
    what: Union[Image, Mesh, Band],
    *,
    text: Optional[str] = None,
    band: Optional[float] = None,
    dense: bool = False,
    half: bool = False,
    metadata: Optional[Mapping[str, str]] = None,
) -> None:
    """Writes a map, an image, a band or a mesh. The ending of the name selects the format:

    .nii .nii.gz .nrrd .mha              an image or map
    .npy                                 the array of a map (float32), without its grid
    .vdb                                 a map or band as an OpenVDB level set
    .ply .stl .obj .off .vtk .vtp        a mesh, or the zero surface of a map

    The file appears under its name only when it is complete. text: a description of one line, for
    images. For .vdb: band, the half width of the band in voxels (default 3); dense=True writes the
    whole map; half=True 16-bit values; metadata, texts by name."""
    if _ends(path, (".vdb",)):
        _write_vdb(path, what, band, dense, half, metadata or {})
    elif isinstance(what, Mesh):
        what.write(path)
    elif isinstance(what, Map) and _ends(path, MESHES):
        what.surface().write(path)
    elif isinstance(what, Map) and not _ends(path, (*WRITTEN_IMAGES, ".npy")):
        known = " ".join((*WRITTEN_IMAGES, ".npy", ".vdb", *MESHES))
        raise UnsupportedError("unsupported", f"write: {os.fspath(path)!r}: the name of a map's file must end in one of {known}")
    elif isinstance(what, Image):
        _write_image(path, what, text)
    else:
        raise argument_error(f"write: need an Image, a Map, a Mesh or, for .vdb, a Band, not {type(what).__name__}")


def _write_image(path: Any, image: Image, text: Optional[str]) -> None:
    if image.values.ndim != 3:
        raise argument_error("write: an image of several layers cannot be written")
    line = text_bytes(image.text if text is None else text, "text") or None
    if image.values.dtype == np.float32:
        call("sdm_image_write", path_bytes(path), image.grid, address(image.values), line)
    else:
        kind = _TYPES.index(image.values.dtype.name)
        call("sdm_volume_write", path_bytes(path), image.grid, address(image.values), kind, line)


def _write_vdb(path: Any, what: Any, band: Optional[float], dense: bool, half: bool, metadata: Mapping[str, str]) -> None:
    words = [(text_bytes(key, "metadata"), text_bytes(value, f"metadata {key}")) for key, value in metadata.items()]
    named = array("sdm_named_value", words)
    callbacks = Callbacks()
    opts = make(
        "sdm_vdb_opts",
        band_voxels=0.0 if band is None else number(band, "band"),
        dense=flag(dense, "dense"),
        half=flag(half, "half"),
        metadata=ctypes.addressof(named),
        n_metadata=len(words),
        cancelled=callbacks.wrap("sdm_vdb_opts", "cancelled", callbacks.stopped, True),
    )
    if isinstance(what, Band):
        blocks = make(
            "sdm_blocks",
            grid=what.grid._c,
            band_mm=what.width,
            n=what.tile.shape[::-1],
            tile=address(what.tile),
            n_block=len(what.first),
            first=address(what.first),
            values=address(what.values),
        )
        callbacks.call("sdm_vdb_write_blocks", path_bytes(path), byref(blocks), byref(opts), None)
    elif isinstance(what, Map):
        callbacks.call("sdm_vdb_write", path_bytes(path), what.grid, address(what.values), byref(opts), None)
    else:
        raise argument_error("write: a .vdb file needs a Map or a Band")
