"""HDF5 below netCDF-4: a lock for its library, and a check that files are self-contained."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

from mesoslip.errors import FileError

# The library is not thread-safe: this lock is held while a file is opened, read, written or closed.
LOCK = threading.RLock()


def check_links(path: Path) -> None:
    """Refuse a file with soft or external links, data in other files, or two names of one object.

    Links are not followed: they may lead to files of others, or to one without end.
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
