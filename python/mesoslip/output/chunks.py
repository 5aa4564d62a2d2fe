"""Chunks of a file, arranged and compressed on several threads.

The library of HDF5 would do that on one thread. It stores finished chunks as they are, and any
program reads them as usual.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mesoslip.output.filling import Block

if TYPE_CHECKING:
    from typing_extensions import Buffer

Array = NDArray[Any]

COMPRESSION_LEVEL = 1


@dataclass(frozen=True)
class _Target:
    """A variable of a file, in chunks or contiguous."""

    dataset: h5py.Dataset
    chunks: tuple[int, ...] | None
    dtype: np.dtype[Any]
    fill_value: Any
    is_compressed: bool

    @classmethod
    def of(cls, dataset: h5py.Dataset) -> _Target:
        is_compressed = dataset.compression is not None
        return cls(dataset, dataset.chunks, dataset.dtype, dataset.fillvalue, is_compressed)

    def packed(self, where: tuple[slice, ...], values: Array) -> _Piece:
        """Values as they are stored, without use of HDF5's library."""
        if self.chunks is None:
            return _Piece(self.dataset, where, values.astype(self.dtype, copy=False))
        if values.shape == self.chunks:
            chunk = np.ascontiguousarray(values, self.dtype)
        else:
            chunk = np.full(self.chunks, self.fill_value, self.dtype)
            chunk[tuple(map(slice, values.shape))] = values
        place = (*(one.start for one in where), *[0] * (len(self.chunks) - len(where)))
        return _Piece(
            self.dataset, place, _compressed(chunk) if self.is_compressed else chunk, True
        )


@dataclass(frozen=True)
class _Piece:
    """Values to be written to a variable: an array, or a chunk as it is stored."""

    dataset: h5py.Dataset
    where: tuple[Any, ...]
    content: bytes | Array
    is_chunk: bool = False

    def write(self) -> None:
        if self.is_chunk:
            self.dataset.id.write_direct_chunk(self.where, self.content)
        else:
            self.dataset[self.where] = self.content


def write_chunks(path: Path, blocks: Iterable[Block], threads: int) -> None:
    """Write blocks, which are chunks of variables of a netCDF-4 file, arranged and compressed on
    threads."""
    with _Storage(path, "r+") as storage:
        with h5py.File(storage, "r+") as file:
            for pieces in _in_order(_with_targets(blocks, file), threads):
                for piece in pieces:
                    piece.write()
                if storage.error is not None:
                    break
        if storage.error is not None:
            raise storage.error


class _Storage(FileIO):
    """A file that hides failed writes from HDF5's library, which would crash as it closes the file;
    the first ``error`` is the last write."""

    error: OSError | None = None

    def write(self, values: Buffer) -> int:
        remaining = memoryview(values)
        try:
            while remaining and self.error is None:
                remaining = remaining[super().write(remaining) :]
        except OSError as error:
            self.error = error
        return len(memoryview(values))

    def truncate(self, size: int | None = None) -> int:
        try:
            if self.error is None:
                return super().truncate(size)
        except OSError as error:
            self.error = error
        return size or 0


def _with_targets(
    blocks: Iterable[Block], file: h5py.File
) -> Iterator[tuple[Block, dict[str, _Target]]]:
    """Blocks with the variables that they fill, by name."""
    known: dict[str, _Target] = {}
    for block in blocks:
        names = {name: f"{block.group}/{name}" for name in block.entries}
        for full in names.values():
            if full not in known:
                known[full] = _Target.of(file[full])
        yield block, {name: known[full] for name, full in names.items()}


def _in_order(
    jobs: Iterable[tuple[Block, dict[str, _Target]]], threads: int
) -> Iterator[list[_Piece]]:
    """Blocks as they are stored, computed on threads a few blocks ahead."""
    if threads == 1:
        for block, targets in jobs:
            yield _packed(block, targets)
        return
    with ThreadPoolExecutor(threads) as pool:
        running: deque[Future[list[_Piece]]] = deque()
        for block, targets in jobs:
            running.append(pool.submit(_packed, block, targets))
            if len(running) > threads:
                yield running.popleft().result()
        while running:
            yield running.popleft().result()


def _packed(block: Block, targets: dict[str, _Target]) -> list[_Piece]:
    return [targets[name].packed(where, values) for name, where, values in block.values()]


def _compressed(chunk: Array) -> bytes:
    """A chunk after HDF5's filters shuffle and zlib."""
    each = chunk.reshape(-1, 1).view(np.uint8)
    return zlib.compress(np.ascontiguousarray(each.T).data, COMPRESSION_LEVEL)
