"""HDF5 below netCDF-4: one lock for its library, and files that are whole in themselves."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

from mesoslip.errors import FileError

# The library is not safe to use on several threads. All that opens, reads, writes or closes a file
# holds this lock.
LOCK = threading.RLock()


def check_links(path: Path) -> None:
    """Make sure that a file refers to nothing outside of it, and that its groups are a tree.

    Links are looked at, not followed: behind them may be a file of somebody else, or one that never
    ends.

    Raises
    ------
    FileError
        If it has soft or external links, data in other files, or an object with two names.
    """
    import h5py

    with LOCK, h5py.File(path, "r") as file:
        root = file.id
        seen = {h5py.h5o.get_info(root).addr}
        groups: list[tuple[str, Any]] = [("", root)]
        while groups:
            parent, group = groups.pop()
            for name in list(group):
                where = f"{parent}/{name.decode(errors='backslashreplace')}"
                if group.links.get_info(name).type != h5py.h5l.TYPE_HARD:
                    raise FileError(f"{path}: {where} is a link, which an output does not have")
                target = h5py.h5o.open(group, name)
                address = h5py.h5o.get_info(target).addr
                if address in seen:
                    raise FileError(f"{path}: {where} has another name too; an output is a tree")
                seen.add(address)
                if isinstance(target, h5py.h5g.GroupID):
                    groups.append((where, target))
                elif isinstance(target, h5py.h5d.DatasetID) and _is_elsewhere(target):
                    raise FileError(f"{path}: {where} has its data in another file")


def _is_elsewhere(dataset: Any) -> bool:
    """Whether data are in other files, as external storage or as a virtual dataset."""
    import h5py

    creation = dataset.get_create_plist()
    return bool(creation.get_external_count() or creation.get_layout() == h5py.h5d.VIRTUAL)
