"""One rank's part of a method, run again and again: recorded once, bound to memory for a number of samples."""

from collections.abc import Mapping
from typing import Any

from mp2a import kernels
from mp2a.program.compiled import CompiledProgram
from mp2a.program.memory import Frame, lay_out
from mp2a.program.recorder import Program, ValueNumber
from mp2a.program.replay import exchange_only, replay
from mp2a.spatial import Array
from mp2a.transport.link import Link, MPILink
from mp2a.transport.mpi import MPITransport
from mp2a.transport.trace import TraceTransport

_KEPT = 1 << 20
"""Bytes of memory that stay from call to call, with the requests that use them. With more samples arithmetic and
messages take far longer than the interpreter, and hundreds of ranks on a machine need the memory for others."""


class RankProgram:
    """Runs a recorded program over a link.

    Parameters
    ----------
    program
        This rank's part of a method.
    link
        Messages of the communicator.
    trace
        Whether to note when each round began and ended, which takes rounds one by one.

    Attributes
    ----------
    transport
        Counts what this rank sends.
    trace
        Notes the rounds, if that is asked for.
    compiled
        The program bound for the number of samples of the last call; None where it is done step by step.
    """

    def __init__(self, program: Program, link: Link, *, trace: bool = False) -> None:
        self.layout = lay_out(program)
        self.transport = MPITransport(link)
        self.trace = TraceTransport(self.transport) if trace else None
        self.compiled: CompiledProgram | None = None

    @property
    def inputs(self) -> Mapping[str, int]:
        """Values that have to be given, by name."""
        return self.layout.program.inputs

    def run(self, inputs: Mapping[str, Array], samples: int, tag: int) -> dict[str, Any]:
        """Run the program; collective.

        Parameters
        ----------
        inputs
            ``(1, T, width)`` arrays by name.
        samples
            T.
        tag
            Of all messages, of what has to be the same on every rank.

        Returns
        -------
        dict of str to array
            The outputs; worth nothing if the transport is not valid afterwards.

        Raises
        ------
        Exception
            What a computation raised here, after all exchanges.
        """
        self.transport.begin(tag, valid=True)
        compiled = self._bound(samples, tag)
        frame = Frame(self.layout, samples) if compiled is None else compiled.frame
        for name, number in self.inputs.items():
            frame.store(number, inputs[name])
        if compiled is not None:
            compiled.run()
        else:
            replay(frame, self.trace or self.transport)
        if not self.transport.valid:
            return {}
        outputs = self.layout.program.outputs
        return {name: frame.result(x) if isinstance(x, ValueNumber) else x for name, x in outputs.items()}

    def fail(self) -> None:
        """Take part in a call of the others with nothing to say; collective."""
        self.transport.begin(1, valid=False)
        exchange_only(Frame(self.layout, 1), self.trace or self.transport)

    def close(self) -> None:
        """Free what is kept for the next call."""
        if self.compiled is not None:
            self.compiled.free()
        self.compiled = None

    def abandon(self) -> None:
        """Withdraw what is in flight, after a call that was broken off."""
        self.transport.abandon()
        if self.compiled is not None:
            self.compiled.abandon()
        self.compiled = None

    def _bound(self, samples: int, tag: int) -> CompiledProgram | None:
        """Bind the program to memory, once for a number of samples; None where it has to be done step by step."""
        if self.compiled is not None and self.compiled.tag == tag and self.compiled.frame.samples == samples:
            return self.compiled
        self.close()
        function = kernels.rounds()
        fast = isinstance(self.transport.link, MPILink) and self.trace is None
        if function is not None and fast and self.layout.size(samples) <= _KEPT:
            self.compiled = CompiledProgram(function, Frame(self.layout, samples), self.transport)
        return self.compiled
