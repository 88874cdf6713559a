"""Training of networks."""

from __future__ import annotations

import ctypes
from ctypes import byref
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Optional, Sequence, Union

from . import _abi
from ._arrays import flag, instance, path_bytes, text_bytes
from ._errors import argument_error
from ._library import Callbacks, make
from ._model import Accuracy, Model, accuracy_of
from ._shape import Registry, Shape


@dataclass(frozen=True)
class Progress:
    """State of a training. `phase`: "trial", "data", "bases", "fit", "refine" or "evaluate". `fraction`: the
    used part of the budget, 0 .. 1. Numbers that are not known are NaN."""

    phase: str
    fraction: float
    step: int
    maps: int
    loss_mm2: float
    heldout_rmse_mm: float
    seconds: float
    seconds_left: float


@dataclass(frozen=True)
class TrainResult:
    """Result of a training."""

    #: the trained network
    model: Model
    #: its file
    path: str
    accuracy: Accuracy
    steps: int
    maps: int
    seconds: float
    #: "good", "usable" or "poor"
    grade: str
    #: what limits the model and what to do, in words; "": nothing that was measured
    sentence: str
    #: the notices that `sdmgen train` prints
    messages: tuple[str, ...]


def train(
    config: Any,
    settings: Union[Mapping[str, Any], Sequence[str]] = (),
    *,
    out: Any = None,
    shape: Optional[Shape] = None,
    plugin: Any = None,
    resume: bool = False,
    force: bool = False,
    progress: Optional[Callable[[Progress], Any]] = None,
) -> TrainResult:
    """Trains a network from the YAML file `config`, as `sdmgen train` does.

    settings: values in place of those of the file: {"network.depth": 4} or ["network.depth=4"]. out: the
    folder of the run (default: that of the configuration). shape: a shape written in Python; its name
    must be the shape.name of the configuration. A folder that holds a model or a checkpoint is refused,
    unless resume=True continues from the checkpoint or force=True starts again. progress: called a few
    times a second. An exception in it, or Ctrl-C, writes a checkpoint and stops the training."""
    if shape is not None:
        instance(shape, Shape, "shape")
    if shape is not None and plugin is not None:
        raise argument_error("train: give a shape or a plug-in, not both")
    lines = [f"{k}={v}" for k, v in settings.items()] if isinstance(settings, Mapping) else [str(s) for s in settings]
    texts = (ctypes.c_char_p * len(lines))(*[text_bytes(line, "settings") for line in lines])
    callbacks, messages = Callbacks(), list[str]()

    def show(_user: Any, at: int) -> None:
        c = _abi.structs["sdm_training_progress"].from_address(at)
        values = {name: getattr(c, name) for name in Progress.__dataclass_fields__}
        if progress is not None:
            progress(Progress(**{**values, "phase": c.phase.decode()}))

    opts = make(
        "sdm_training_opts",
        settings=ctypes.addressof(texts),
        n_settings=len(lines),
        folder=None if out is None else path_bytes(out, "out"),
        resume=flag(resume, "resume"),
        force=flag(force, "force"),
        progress=callbacks.wrap("sdm_training_opts", "progress", show, None),
        cancelled=callbacks.wrap("sdm_training_opts", "cancelled", callbacks.stopped, True),
        message=callbacks.wrap("sdm_training_opts", "message", lambda _user, line: messages.append(line.decode()), None),
    )
    result = make("sdm_training_result")
    registry = Registry(plugin) if shape is None else shape._registry
    arguments = (path_bytes(config, "config"), registry, byref(opts), byref(result))
    if shape is None or shape._python is None:
        callbacks.call("sdm_training_run", *arguments)
    else:
        shape._python.call_with(callbacks, "sdm_training_run", *arguments)
    path = result.model_path.decode()
    return TrainResult(
        Model(path, shape=shape, plugin=plugin),
        path,
        accuracy_of(result.accuracy),
        result.steps,
        result.maps,
        result.seconds,
        result.grade.decode(),
        result.sentence.decode(),
        tuple(messages),
    )
