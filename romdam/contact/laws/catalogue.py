"""Laws by name: romdam's own, and those of a user's file."""

from __future__ import annotations

import keyword
import math
import os
import sys
from collections.abc import Mapping
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from romdam.contact.laws import LAWS
from romdam.contact.laws.crack_water import CrackWater
from romdam.contact.laws.law import AXES, COHESION_J, ENTRIES, MU_K, STEP_ENTRIES, Law, Parameter
from romdam.contact.laws.shear_stiffness import ElasticShear
from romdam.core.errors import ConfigError, listed, quote
from romdam.core.fingerprint import fingerprint
from romdam.core.system import GapLaw, LawSource

_OWN = {law.__name__: law for law in (*LAWS, ElasticShear, CrackWater)}
_ARGUMENTS = {
    "limit": ("parameters", "memory", "step", "limit"),
    "release": ("parameters", "memory", "step"),
    "commit": ("parameters", "memory", "step"),
}
_UNITS = ("", "axes", "m", "s", "m/s", "Pa", "N", "N/m", "N/m^3", "N*s/m^3", "1/s", "Hz")
_RESERVED = {"between", "law", "gap", "gaps", "normal", "tolerance"}  # keys of a joint that no law may add
_LOADED: dict[LawSource, type[Law]] = {}


def source_of(law: type[Law]) -> LawSource:
    """Find the source of a law of romdam, or of one that `user_law` has loaded."""
    if law in _OWN.values():
        return LawSource(law.__name__)
    return next(source for source, loaded in _LOADED.items() if loaded is law)


def law_order(law: type[Law]) -> tuple[int, str]:
    """Key of the order in which laws apply: a user's own come last, by name."""
    return LAWS.index(law) if law in LAWS else len(LAWS), source_of(law).name


def find_law(source: LawSource) -> type[Law]:
    """Find a law, in the process that has loaded it or in another.

    Raises
    ------
    ConfigError
        for a user's file that is gone or has changed since.
    """
    if source.name in _OWN:
        return _OWN[source.name]
    if source not in _LOADED:
        now = user_law(source.name, Path(source.file))
        if now != source:
            raise ConfigError(
                f"{source.file}: it, or what it takes from elsewhere, has changed since law {source.name} "
                "was read from it; start again"
            )
    return _LOADED[source]


def loaded_law(name: str, sha256: str) -> LawSource:
    """Find the source of a user's law that has been loaded in this process.

    Raises
    ------
    ConfigError
        where it has not.
    """
    for source in _LOADED:
        if (source.name, source.sha256) == (name, sha256):
            return source
    raise ConfigError(
        f"law {quote(name)}, SHA-256 {sha256[:12]}: its file, or what that takes from elsewhere, is not at "
        "hand or has changed since"
    )


def further_keys(law: GapLaw) -> list[str]:
    """Keys of joints that give the gaps more than stiffness and friction."""
    keys = {key for one in law.laws for key in find_law(one.law).key_names()}
    return sorted(keys | {"viscosity"} if law.viscosity.any() else keys)


def user_law(name: str, file: Path) -> LawSource:
    """Load a law, module.Class, from the module's file and check that it keeps to the protocol.

    Raises
    ------
    ConfigError
        for a file that cannot be read or run, and for a class that is none or does not keep to the protocol.
    """
    from romdam.contact.laws.outside import closed

    try:
        content = file.read_bytes()
    except OSError as error:
        raise ConfigError(f"law {quote(name)}: cannot read {file}: {error.strerror}") from None
    absolute = file.absolute()
    law = getattr(_module(absolute, content), name.rpartition(".")[2], None)
    if not (isinstance(law, type) and issubclass(law, Law) and law is not Law):
        raise ConfigError(f"law {quote(name)}: {file} has no class of that name that is a romdam.contact.Law")
    _check(law, f"{file}: {law.__name__}")
    # all that a law is: its file, what that has taken from elsewhere, and what it brings to a run
    functions = {function: getattr(law, function) for function in _ARGUMENTS}
    outside = {
        function: closed(each, str(absolute)).content
        for function, each in functions.items()
        if each is not None
    }
    declared = (
        law.section,
        law.parameters,
        law.memory,
        bool(law.shear),
        bool(law.strength),
        bool(law.follows_step),
    )
    source = LawSource(name, str(absolute), fingerprint((content, outside, declared)))
    _LOADED.setdefault(source, law)
    return source


def _module(file: Path, content: bytes) -> ModuleType:
    """Run a user's file, anew for every joint that names it: what it reads or imports may be other by now.

    What runs are the bytes that were hashed: the import system would read the file again, or take what it
    compiled of another content with the same time and size, which it leaves beside the file.
    """
    from romdam.core.kept_code import keeping_nothing

    about, before = fingerprint((str(file), content)), _modules_of_folder(file)
    for name in before:
        del sys.modules[name]
    module = ModuleType(f"romdam_law_{file.stem}_{about[:12]}")
    module.__file__ = str(file)
    sys.modules[module.__name__] = module  # where dataclasses look for the names of annotations
    try:
        code = compile(content, str(file), "exec", dont_inherit=True)
        with keeping_nothing():
            exec(code, module.__dict__)
    except BaseException as error:  # whatever a user's file raises
        sys.modules.pop(module.__name__, None)
        if isinstance(error, Exception | SystemExit):
            raise ConfigError(f"{file}: cannot be run: {type(error).__name__}: {error}") from error
        raise
    finally:
        for name in _modules_of_folder(file).keys() - {module.__name__}:
            del sys.modules[name]
        sys.modules.update({name: one for name, one in before.items() if name != module.__name__})
    return module


def _modules_of_folder(file: Path) -> dict[str, ModuleType]:
    """Imported modules whose files lie with a user's, by name: the law has what they are now."""
    modules, folder = {}, file.parent.name.lower()
    for name, module in list(sys.modules.items()):
        place = str(getattr(module, "__file__", None) or "/")
        if folder not in place.lower() and os.path.isabs(place):  # of thousands: paths take 20 us each
            continue
        path = Path(place).absolute()
        installed = name.partition(".")[0] in ("__main__", "romdam") or "site-packages" in path.parts
        if file.parent in path.parents and not installed:
            modules[name] = module
    return modules


def _check(law: type[Law], place: str) -> None:
    """Refuse what would fail, or be silently nothing, later."""
    own = {key for each in LAWS for key in each.key_names()} | _RESERVED
    names = [parameter.name for parameter in law.parameters if isinstance(parameter, Parameter)]
    if not names or len(names) != len(law.parameters) or len(set(names)) != len(names):
        raise ConfigError(f"{place}.parameters must be a tuple of Parameters with names of their own")
    wrong = [
        name for name in (*names, *law.key_names()) if not name.isidentifier() or keyword.iskeyword(name)
    ]
    if wrong:
        raise ConfigError(f"{place}.parameters: {quote(wrong[0])} is no name; use letters, digits and _")
    taken = sorted(own & set(law.key_names()))
    if taken:
        raise ConfigError(f"{place}: {listed(taken)} is a key of joints already; choose another name")
    units = sorted({parameter.unit for parameter in law.parameters} - set(_UNITS))
    if units:
        raise ConfigError(
            f"{place}.parameters: unit {quote(units[0])} is not known; known are {listed(_UNITS[1:])}"
        )
    if law.array:
        raise ConfigError(f"{place}.array: the gaps' own arrays are romdam's; leave it out")
    if law.limit is None:
        raise ConfigError(f"{place}: a law without the function `limit` does nothing; define it")
    for name, wanted in _ARGUMENTS.items():
        function = getattr(law, name)
        taken = [] if function is None else [*signature(getattr(function, "py_func", function)).parameters]
        if taken and len(taken) != len(wanted):
            raise ConfigError(
                f"{place}.{name} must be {name}({', '.join(wanted)}), as from version 0.3 on, got "
                f"{name}({', '.join(taken)}); `step` has what it took of a gap (romdam.contact.laws.law)"
            )
    if law.release is not None and not law.memory:
        raise ConfigError(f"{place}.release has no `memory` to note in what was given up; name what it keeps")
    values: dict[str, Any] = {}
    for parameter in law.parameters:
        if parameter.unit == "axes":
            values[parameter.name] = AXES
            continue
        if parameter.choices:
            values[parameter.name] = parameter.choices[0]
            continue
        sample = min(parameter.least + 0.5, math.inf if parameter.most is None else parameter.most)
        values[parameter.name] = (sample, sample) if parameter.both else sample
    try_law(law, {law.section: values} if law.section else values, place)


def try_law(law: type[Law], joint: Mapping[str, Any], place: str) -> None:
    """Call the functions once with a joint's values: what they raise is told before a run.

    Raises
    ------
    ConfigError
        for an exception, a memory of another length than its names, and shear that no direction would carry.
    """
    limit, step, name = np.zeros(ENTRIES), np.zeros(STEP_ENTRIES), "row"
    try:
        parameters = np.array(law.row(joint, 1.0), dtype=float)
        memory = np.array(law.initial(parameters, 0.0), dtype=float)
        for name, rest in (
            ("limit", (step, limit)),
            ("release", (step,)),
            ("commit", (step,)),
        ):
            function = getattr(law, name)
            if function is not None:
                function(parameters, memory, *rest)
    except Exception as error:  # whatever a user's function raises
        raise ConfigError(f"{place}.{name} cannot be called: {type(error).__name__}: {error}") from error
    if len(memory) != len(law.memory):
        raise ConfigError(f"{place}.initial gives {len(memory)} numbers for {len(law.memory)} of `memory`")
    if limit[COHESION_J : MU_K + 1].any() and not law.shear:
        raise ConfigError(f"{place}.limit bounds the shear, which no gap carries; set `shear = True`")
