"""The only place that starts Taichi: arch, threads, precision, and the pool of fields."""

from __future__ import annotations

import contextlib
import io
import time
import warnings
from typing import Any

import numpy as np

from tisoft.cores import Cores, permitted
from tisoft.errors import SceneError
from tisoft.reading_kernels import keep_what_is_read

ARCHS = ("cpu", "cuda", "metal", "vulkan", "auto")

_started: str | None = None
_pool: Any = None
_kernels: dict[Any, Any] = {}
_most_threads: int | None = None
cores = Cores()
"""Those that threads of this start of Taichi run on."""
generation = 0
"""How often Taichi was started; fields and kernels of an older start are dead."""


def import_taichi() -> Any:
    """The taichi module, quietly; says what to install where its one system library is missing."""
    try:
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            # Of strings in Taichi's own files, where no byte code of theirs is kept.
            warnings.simplefilter("ignore", SyntaxWarning)
            import taichi
    except ImportError as error:
        if "libX11" in str(error):
            raise SceneError(
                "Taichi needs the system library libX11.so.6, which is missing; "
                "install it with: apt-get install -y libx11-6"
            ) from None
        raise
    keep_what_is_read()
    return taichi


def start(arch: str = "cpu", *, threads: int | None = None) -> str:
    """Start Taichi on `arch` unless it runs there already; returns the arch in use.

    Args:
        arch: "cpu", "cuda", "metal", "vulkan", or "auto" (cuda or metal where there is one, else
            cpu).
        threads: CPU threads that scenes take at the most; None for all.  Taichi's own number
            stays: it is part of what kernels in the disk cache are known by.

    Raises:
        SceneError: an unknown arch, or one that this machine lacks.
    """
    global _started, generation, _pool, _most_threads, cores
    if arch not in ARCHS:
        raise SceneError(f"arch is {arch!r}; choose one of {', '.join(ARCHS)}")
    ti = import_taichi()
    if arch == "auto":
        arch = next((a for a in ("cuda", "metal") if _present(ti, a)), "cpu")
    if not _present(ti, arch):
        raise SceneError(f"arch is {arch!r}, which this machine does not offer; use --arch cpu")
    if _started == arch:
        return arch
    _most_threads = threads
    with contextlib.redirect_stdout(io.StringIO()):
        ti.init(
            arch=getattr(ti, arch),
            default_fp=ti.f32,
            fast_math=False,
            # Taichi's own search for loads that stores already tell doubles the time to compile and
            # hinders LLVM's vectoriser; LLVM does it afterwards anyway.
            cfg_optimization=False,
            offline_cache=True,
            log_level=ti.ERROR,
        )
    _started = arch
    _pool = None
    cores = Cores()
    generation += 1
    return arch


def _present(ti: Any, arch: str) -> bool:
    return arch == "cpu" or bool(ti.lang.misc.is_arch_supported(getattr(ti, arch)))


def on_cpu() -> bool:
    """Whether kernels run on the CPU."""
    return _started == "cpu"


def on_device() -> bool:
    """Whether kernels run on a GPU."""
    return _started is not None and _started != "cpu"


def has_f64() -> bool:
    """Whether kernels compute in f64 on the arch in use; Metal's do not."""
    return _started != "metal"


def threads() -> int:
    """CPU threads that a scene may take."""
    pool = min(int(import_taichi().cfg.cpu_max_num_threads), permitted())
    return pool if _most_threads is None else min(pool, _most_threads)


def real_type(precision: str) -> tuple[Any, Any]:
    """(NumPy, Taichi) types of "f32" or "f64"."""
    ti = import_taichi()
    return (np.float64, ti.f64) if precision == "f64" else (np.float32, ti.f32)


def pool(kind: Any) -> Any:
    """The `kind` (a pool of fields) of this start of Taichi, made once."""
    global _pool
    if _pool is None:
        _pool = kind()
    return _pool


def kernels_of_laws() -> dict[Any, Any]:
    """Kernels that close over no fields, by what they compute, of this start of Taichi."""
    if _kernels.get("generation") != generation:
        _kernels.clear()
        _kernels["generation"] = generation
    return _kernels


compilations = 0
"""Kernels of scenes compiled so far."""
compile_seconds = 0.0
"""Seconds that their first launches took."""


def compiled_as_written(kernel: Any) -> Any:
    """The kernel, which Taichi does not search for what is computed twice, as long as n² takes for
    n instructions: for kernels so long that somebody would wait.  LLVM finds most of it: contact
    of surfaces compiles in 9 s, not 21, and steps 3 to 6 % slower.
    """
    config_of = import_taichi().lang.impl.current_cfg

    def call(*args: Any) -> Any:
        config = config_of()
        config.advanced_optimization = False
        try:
            return kernel(*args)
        finally:
            config.advanced_optimization = True

    return call


def timed(kernel: Any) -> Any:
    """A kernel whose first launch, which compiles it, is counted and timed."""
    is_new = True

    def launch(*arguments: Any) -> Any:
        nonlocal is_new
        global compilations, compile_seconds
        if not is_new:
            return kernel(*arguments)
        begun = time.perf_counter()
        result = kernel(*arguments)
        is_new = False
        compilations += 1
        compile_seconds += time.perf_counter() - begun
        return result

    return launch
