"""A small importer of FMUs, by ctypes: co-simulation of FMI 2.0 and 3.0, model exchange of 2.0."""

from __future__ import annotations

import ctypes
import io
import itertools
import zipfile
from collections.abc import Callable, Mapping, Sequence
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

import numpy as np

_LOGGER2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_UPDATE3 = ctypes.CFUNCTYPE(
    None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool,
    ctypes.POINTER(c_bool), ctypes.POINTER(c_double),
)  # fmt: skip
_LOGGER3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class _Callbacks2(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER2),
        ("allocate", c_void_p),
        ("release", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    )


class _EventInfo(ctypes.Structure):
    _fields_ = (
        ("needed", c_int),
        ("terminate", c_int),
        ("nominals", c_int),
        ("values", c_int),
        ("defined", c_int),
        ("next", c_double),
    )


def with_another_word(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a resource of an FMU with another word after its first two, which identify it."""
    words = np.frombuffer(data, dtype=np.int64).copy()
    words[rng.integers(2, len(words))] = rng.integers(-5, 1 << int(rng.integers(1, 63)))
    return words.tobytes()


class FmuError(Exception):
    """A function of the FMU has failed; the message is what it reported."""


class Unpacked:
    """An FMU in a folder."""

    def __init__(self, content: bytes, folder: Path):
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            file.extractall(folder)
            self.names = file.namelist()
        self.folder = folder
        self.description = Xml.parse(folder / "modelDescription.xml").getroot()
        self.version = self.description.get("fmiVersion", "")
        listed = self.description.find("ModelVariables")
        assert listed is not None
        self.variables = {x.get("name", ""): x for x in listed}
        self.references = {n: int(x.get("valueReference", -1)) for n, x in self.variables.items()}
        identifier = self.description.find("CoSimulation").get("modelIdentifier")  # type: ignore[union-attr]
        self.binaries = sorted(folder.glob(f"binaries/*/{identifier}.*"))

    def instance(self, exchange: bool = False, **options: Any) -> Instance:
        """Make an instance."""
        return Instance(self, exchange, **options)


class Step(NamedTuple):
    """What a step of FMI 3.0 returns: flags, and the time it has reached."""

    event: bool
    terminate: bool
    early: bool
    time: float


class Instance:
    """An instance of an FMU.

    Parameters
    ----------
    fmu : Unpacked
    exchange : bool
        Whether it is for model exchange.
    events, early : bool
        Whether the importer handles events, and lets steps end early, in FMI 3.0.
    update : callable, optional
        Called with the time within steps; returns the time at which the step is to end, or None.
    """

    def __init__(
        self,
        fmu: Unpacked,
        exchange: bool = False,
        events: bool = False,
        early: bool = False,
        update: Callable[[float], float | None] | None = None,
    ):
        self.fmu, self.three = fmu, fmu.version == "3.0"
        # the platform of this machine: the only one there is in these tests
        self.library = ctypes.CDLL(str(fmu.binaries[0]))
        self.messages: list[str] = []
        resources, token = fmu.folder / "resources", fmu.description
        if self.three:
            self._logger: Any = _LOGGER3(lambda env, status, category, text: self._log(text))
            name = "InstantiateModelExchange" if exchange else "InstantiateCoSimulation"
            make = getattr(self.library, f"fmi3{name}")
            make.restype = c_void_p
            given = (b"one", token.get("instantiationToken", "").encode())
            head = (*given, f"{resources}/".encode(), c_bool(False), c_bool(False))
            more = () if exchange else (c_bool(events), c_bool(early), None, c_size_t(0))
            self._update: Any = None if update is None else _UPDATE3(self._updated(update))
            last = () if exchange else (self._update,)
            self.handle = c_void_p(make(*head, *more, None, self._logger, *last))
        else:
            logger = _LOGGER2(lambda env, name, status, category, text: self._log(text))
            self._logger = _Callbacks2(logger, None, None, None, None)
            self.library.fmi2Instantiate.restype = c_void_p
            self.handle = c_void_p(
                self.library.fmi2Instantiate(
                    b"one", 0 if exchange else 1, token.get("guid", "").encode(),
                    resources.as_uri().encode(), byref(self._logger), 0, 0,
                )
            )  # fmt: skip
        if not self.handle.value:
            raise FmuError(*self.messages)

    @staticmethod
    def _updated(update: Callable[[float], float | None]) -> Callable[..., None]:
        def called(env: Any, t: float, *flags: Any) -> None:
            _, _, _, may_return, early, end = flags
            wanted = update(t)
            if wanted is not None and may_return:
                early[0], end[0] = True, wanted

        return called

    def _log(self, text: bytes) -> None:
        self.messages.append(text.decode().replace("%%", "%"))

    def call(self, name: str, *arguments: Any, allowed: Sequence[int] = (0,)) -> int:
        """Call a function; raise FmuError unless its status is allowed."""
        function = getattr(self.library, ("fmi3" if self.three else "fmi2") + name)
        status: int = function(self.handle, *arguments)
        if status not in allowed:
            raise FmuError(self.messages[-1] if self.messages else name)
        return status

    def free(self) -> None:
        """Free the instance."""
        self.library[("fmi3" if self.three else "fmi2") + "FreeInstance"](self.handle)

    def set(self, values: Mapping[str, float]) -> None:
        """Set variables."""
        n = len(values)
        references = (c_uint * n)(*(self.fmu.references[name] for name in values))
        numbers = (c_double * n)(*values.values())
        more = (c_size_t(n),) if self.three else ()
        name = "SetFloat64" if self.three else "SetReal"
        self.call(name, references, c_size_t(n), numbers, *more)

    def get(self, *names: str) -> list[float]:
        """Return the values of variables."""
        n = len(names)
        references = (c_uint * n)(*(self.fmu.references[name] for name in names))
        numbers = (c_double * n)()
        more = (c_size_t(n),) if self.three else ()
        self.call(
            "GetFloat64" if self.three else "GetReal", references, c_size_t(n), numbers, *more
        )
        return list(numbers)

    def begin(self, start: float, values: Mapping[str, float] | None = None) -> None:
        """Initialize with values of parameters and of the initial state."""
        if self.three:
            self.set(values or {})
            more = (c_bool(False), c_double(0.0), c_double(start), c_bool(False), c_double(0.0))
            self.call("EnterInitializationMode", *more)
        else:
            self.call("SetupExperiment", 0, c_double(0), c_double(start), 0, c_double(0))
            self.set(values or {})
            self.call("EnterInitializationMode")
        self.call("ExitInitializationMode")

    def step(self, t: float, size: float) -> bool:
        """Go on by a step; return whether the simulation has ended."""
        if not self.three:
            return self.call("DoStep", c_double(t), c_double(size), 1, allowed=(0, 2)) == 2
        return self.step3(t, size).terminate

    def step3(self, t: float, size: float) -> Step:
        """Go on by a step of FMI 3.0."""
        needed, end, early, last = c_bool(), c_bool(), c_bool(), c_double()
        refs = byref(needed), byref(end), byref(early), byref(last)
        self.call("DoStep", c_double(t), c_double(size), c_bool(True), *refs)
        return Step(needed.value, end.value, early.value, last.value)

    def happen(self) -> tuple[bool, float]:
        """Handle an event of FMI 3.0; return whether it ends the simulation, and the next time."""
        self.call("EnterEventMode")
        flags = [c_bool() for _ in range(5)]
        following = c_double()
        self.call("UpdateDiscreteStates", *map(byref, flags), byref(following))
        if not flags[1].value:
            self.call("EnterStepMode")
        return flags[1].value, following.value

    def simulate(
        self,
        times: Sequence[float],
        names: Sequence[str],
        values: Mapping[str, float] | None = None,
    ) -> Any:
        """Return the values of variables at times, (times, names), of a co-simulation."""
        self.begin(times[0], values)
        rows = [self.get(*names)]
        for t, following in itertools.pairwise(times):
            ended = self.step(t, following - t)
            rows.append(self.get(*names))
            if ended:
                break
        return np.array(rows)

    # the state of an instance

    def save(self) -> c_void_p:
        """Return its state."""
        state = c_void_p()
        self.call("GetFMUState" if self.three else "GetFMUstate", byref(state))
        return state

    def restore(self, state: c_void_p) -> None:
        """Go back to a state."""
        self.call("SetFMUState" if self.three else "SetFMUstate", state)

    def serialize(self, state: c_void_p) -> bytes:
        """Return a state as bytes."""
        name, size = "State" if self.three else "state", c_size_t()
        self.call(f"SerializedFMU{name}Size", state, byref(size))
        content = (ctypes.c_char * size.value)()
        self.call(f"SerializeFMU{name}", state, content, size)
        return bytes(content)

    def restore_from(self, content: bytes) -> None:
        """Go to a state that this instance, or another one, has serialized."""
        state = c_void_p()
        name = "DeserializeFMUState" if self.three else "DeSerializeFMUstate"
        self.call(name, content, c_size_t(len(content)), byref(state))
        try:
            self.restore(state)
        finally:
            self.forget(state)

    def forget(self, state: c_void_p) -> None:
        """Free a state."""
        self.call("FreeFMUState" if self.three else "FreeFMUstate", byref(state))

    # derivatives

    def directional(
        self,
        unknowns: Sequence[str],
        knowns: Sequence[str],
        seed: Sequence[float],
        adjoint: bool = False,
    ) -> Any:
        """Return the changes of unknowns along changes of knowns; or those of knowns, added up."""
        numbers = (c_double * len(seed))(*seed)
        out = (c_double * len(knowns if adjoint else unknowns))()
        arguments: list[Any] = []
        for names in (unknowns, knowns):
            arguments.append((c_uint * len(names))(*(self.fmu.references[x] for x in names)))
            arguments.append(c_size_t(len(names)))
        more = (c_size_t(len(seed)), out, c_size_t(len(out))) if self.three else (out,)
        name = "GetAdjointDerivative" if adjoint else "GetDirectionalDerivative"
        self.call(name, *arguments, numbers, *more)
        return np.array(out)

    def move(self, t: float, states: Sequence[float]) -> None:
        """Go to a state of model exchange."""
        n = len(states)
        self.call("SetTime", c_double(t))
        self.call("SetContinuousStates", (c_double * n)(*states), c_size_t(n))

    # model exchange of FMI 2.0

    def exchanged(self, end: float, steps: int, count: int) -> Any:
        """Return (q, v) of model exchange, by the classical Runge-Kutta method."""
        self.begin(0.0)
        info = _EventInfo()
        self.call("NewDiscreteStates", byref(info))
        self.call("EnterContinuousTimeMode")
        states = (c_double * count)()
        rates = (c_double * count)()
        self.call("GetContinuousStates", states, c_size_t(count))
        y, h = np.array(states), end / steps

        def derivative(t: float, y: Any) -> Any:
            self.call("SetTime", c_double(t))
            self.call("SetContinuousStates", (c_double * count)(*y), c_size_t(count))
            self.call("GetDerivatives", rates, c_size_t(count))
            return np.array(rates)

        for i in range(steps):
            t = i * h
            a = derivative(t, y)
            b = derivative(t + h / 2, y + h / 2 * a)
            c = derivative(t + h / 2, y + h / 2 * b)
            d = derivative(t + h, y + h * c)
            y = y + h / 6 * (a + 2 * b + 2 * c + d)
            derivative(t + h, y)
            event, terminate = c_int(), c_int()
            self.call("CompletedIntegratorStep", 1, byref(event), byref(terminate))
            if event.value:
                self.call("EnterEventMode")
                self.call("NewDiscreteStates", byref(info))
                self.call("EnterContinuousTimeMode")
                self.call("GetContinuousStates", states, c_size_t(count))
                y = np.array(states)
        return y
