"""The only place that starts Taichi: arch, threads, arrays, and launches without Python's toll.

A Taichi launch with 20 arrays costs 200 µs of Python; a small scene's frame takes as long.  `bind`
therefore prepares a launch once (arrays fixed, a few integers free) and repeats it for 5 µs.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError

ARCHS = ("cpu", "cuda", "metal", "vulkan", "auto")

_started: str | None = None
generation = 0
"""How often Taichi was started; arrays and launches of an older start are dead."""


def import_taichi() -> Any:
    """The taichi module, quietly; says what to install where its one system library is missing."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            import taichi
    except ImportError as error:
        if "libX11" in str(error):
            raise SceneError(
                "Taichi needs the system library libX11.so.6, which is missing; "
                "install it with: apt-get install -y libx11-6"
            ) from None
        raise
    return taichi


def start(arch: str = "cpu", *, threads: int | None = None) -> str:
    """Start Taichi on `arch` unless it runs there already; returns the arch in use.

    Args:
        arch: "cpu", "cuda", "metal", "vulkan", or "auto" (cuda or metal where there is one, else
            cpu).
        threads: CPU threads at the most; None for all.

    Raises:
        SceneError: an unknown arch, or one that this machine lacks.
    """
    global _started, generation
    if arch not in ARCHS:
        raise SceneError(f"arch is {arch!r}; choose one of {', '.join(ARCHS)}")
    ti = import_taichi()
    if arch == "auto":
        arch = next((a for a in ("cuda", "metal") if _present(ti, a)), "cpu")
    if not _present(ti, arch):
        raise SceneError(f"arch is {arch!r}, which this machine does not offer; use --arch cpu")
    if _started == arch:
        return arch
    options: dict[str, Any] = {}
    if threads is not None:
        options["cpu_max_num_threads"] = threads
    with contextlib.redirect_stdout(io.StringIO()):
        ti.init(
            arch=getattr(ti, arch),
            default_fp=ti.f32,
            fast_math=False,
            offline_cache=True,
            log_level=ti.ERROR,
            **options,
        )
    _started = arch
    generation += 1
    return arch


def _present(ti: Any, arch: str) -> bool:
    core = ti._lib.core
    if arch == "cpu":
        return True
    return bool(getattr(core, f"with_{arch}")())


def on_cpu() -> bool:
    """Whether arrays are NumPy arrays, read and written by kernels where they are."""
    return _started == "cpu"


def has_f64() -> bool:
    """Whether kernels compute in f64 on the arch in use; Metal's do not."""
    return _started != "metal"


def threads() -> int:
    """CPU threads of Taichi's pool."""
    return int(import_taichi().cfg.cpu_max_num_threads)


def array(values: NDArray[Any]) -> Any:
    """An array that kernels take: NumPy's own memory on the CPU, device memory elsewhere."""
    values = np.ascontiguousarray(values)
    if on_cpu():
        return values.copy() if not values.flags.writeable else values
    ti = import_taichi()
    device = ti.ndarray(ti.i32 if values.dtype.kind == "i" else _real(values.dtype), values.shape)
    device.from_numpy(values)
    return device


def read(values: Any) -> NDArray[Any]:
    """A NumPy array of what `values` holds; on the CPU the memory itself, not a copy."""
    if isinstance(values, np.ndarray):
        return values
    out: NDArray[Any] = values.to_numpy()
    return out


def write(target: Any, values: NDArray[Any]) -> None:
    """Copy `values` into an array made by `array`."""
    if isinstance(target, np.ndarray):
        target[...] = values
    else:
        target.from_numpy(np.ascontiguousarray(values, dtype=target.to_numpy().dtype))


def _real(dtype: np.dtype[Any]) -> Any:
    ti = import_taichi()
    return ti.f64 if dtype == np.float64 else ti.f32


def real_type(precision: str) -> tuple[Any, Any]:
    """(NumPy, Taichi) types of "f32" or "f64"."""
    ti = import_taichi()
    return (np.float64, ti.f64) if precision == "f64" else (np.float32, ti.f32)


def bind(kernel: Any, *arguments: Any) -> Callable[..., None]:
    """Compile `kernel` for these arguments and return a launch of it.

    The launch takes new values for the leading integers among the arguments and leaves the rest
    (arrays are kept alive and used where they are).  It uses Taichi's own steps of a call, without
    the checks that Python repeats at each.
    """
    primal = kernel._primal
    key = primal.ensure_compiled(*arguments)
    compiled = primal.compiled_kernels[key]
    program = primal.runtime.prog
    context = compiled.make_launch_context()
    slots: list[int] = []
    place = 0  # templates take no slot in the launch
    ti = import_taichi()
    for argument, value in zip(primal.arguments, arguments, strict=True):
        note = argument.annotation
        if note is ti.template or isinstance(note, ti.template):
            continue
        if isinstance(value, np.ndarray):
            tensor = getattr(note.dtype, "ndim", 0)
            shape = value.shape[: value.ndim - tensor] if tensor else value.shape
            context.set_arg_external_array_with_shape(
                (place,), value.ctypes.data, value.nbytes, shape, 0
            )
        elif isinstance(value, (int, np.integer)):
            context.set_arg_int((place,), int(value))
            slots.append(place)
        else:
            context.set_arg_ndarray((place,), value.arr)
        place += 1
    ready = program.compile_kernel(program.config(), program.get_device_caps(), compiled)
    born = generation

    def launch(*integers: int, keep: Any = arguments) -> None:
        if born != generation:
            raise RuntimeError(
                "this simulation belongs to an earlier start of Taichi; make it anew"
            )
        for slot, value in zip(slots, integers, strict=False):
            context.set_arg_int((slot,), value)
        program.launch_kernel(ready, context)

    return launch
