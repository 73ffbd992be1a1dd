# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""`find_recordings`: lists the recordings at paths, patterns and URLs, without reading them."""

from __future__ import annotations

import hashlib
import os
import re
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from pathlib import PurePosixPath
from typing import Any

from ..errors import PiezoError, RecordingError, printable
from ..recording.formats.csv import ENDINGS as TABLES
from .source import NamePattern, Source, changed_at, version_of
from .storage import Storage

ENDINGS = frozenset((*TABLES, ".mat", ".npz", ".npy", ".h5", ".hdf5", ".hdf", ".tdms", ".mcap", ".db3"))
"""Endings of files that count as recordings in a folder or pattern."""
_BAG = frozenset((".mcap", ".db3", ".zstd"))
"""Endings of the files of a bag."""
_PHASE = re.compile(r"\d{1,3}[_ -][A-Za-z]\w*\.npz")
"""Name of a phase by which a folder of NPZ files is one experiment."""
_MAGIC = re.compile(r"[*?\[]")
"""Characters that make a path a pattern."""

Info = dict[str, Any]


def find_recordings(
    urls: Sequence[str], storage: Storage | None = None, names: NamePattern | None = None
) -> tuple[Source, ...]:
    """List the recordings at URLs, each once, sorted by URL.

    Parameters
    ----------
    urls : sequence of str
        Files, folders or patterns with ``*``, ``?`` and ``**``: local, s3:// or http(s)://. In a folder, at any depth,
        a bag is one recording, a folder of ``NN_<phase>.npz`` is one, and so is every other file with a known ending.
    storage : Storage, optional
        Access to S3.
    names : NamePattern, optional
        Pattern that finds stage and date in a URL.

    Returns
    -------
    tuple of Source

    Raises
    ------
    RecordingError
        If there is no recording at a URL, or its storage cannot be reached.
    """
    storage, names = storage or Storage(), names or NamePattern()
    found: dict[str, Source] = {}
    for url in urls:
        try:
            sources = list(_named_by(url, storage, names))
        except PiezoError:
            raise
        except Exception as error:  # storages raise different exceptions
            said = printable(" ".join(str(error).split())) or type(error).__name__
            raise RecordingError(f"{url}: {said}; expected a file, a folder or a pattern that can be read") from None
        if not sources:
            raise RecordingError(f"{url}: got no recording, expected files ending {', '.join(sorted(ENDINGS))}")
        found |= {source.url: source for source in sources}
    return tuple(found[url] for url in sorted(found))


def _named_by(url: str, storage: Storage, names: NamePattern) -> Iterator[Source]:
    fs, path = storage.open(url)
    if _MAGIC.search(path) and not fs.exists(path):  # a file may be called run[1].csv
        matches = fs.glob(path, detail=True)
    else:
        info = fs.info(path)
        if info["type"] != "directory":
            yield _source(fs, [{**info, "name": path}], "", storage, names)
            return
        matches = {path: info}
    files: dict[str, Info] = {}
    for name, info in matches.items():
        files |= _files_in(fs, name) if info["type"] == "directory" or _is_folder(fs, name) else {name: info}
    folders: dict[str, list[Info]] = defaultdict(list)
    for name, info in sorted(files.items()):
        folders[name.rpartition("/")[0]].append({**info, "name": name})
    for folder, infos in folders.items():
        yield from _in_folder(fs, folder, infos, storage, names)


def _is_local(fs: Any) -> bool:
    return "file" in ((fs.protocol,) if isinstance(fs.protocol, str) else fs.protocol)


def _is_folder(fs: Any, name: str) -> bool:
    """Whether a name on a disk is a link to a folder; fsspec calls it neither file nor folder."""
    return _is_local(fs) and os.path.isdir(name)


def _files_in(fs: Any, place: str) -> dict[str, Info]:
    """All files in a folder, at any depth.

    On a disk, links to folders are followed, each folder is read once, and the times are those of the linked files.
    """
    if not _is_local(fs):
        return dict(fs.find(place, detail=True))
    files: dict[str, Info] = {}
    waiting, seen = deque([place]), set()
    while waiting:
        for folder, inner, names in os.walk(waiting.popleft()):
            real = os.path.realpath(folder)
            if real in seen:
                inner.clear()
                continue
            seen.add(real)
            waiting += [path for name in inner if os.path.islink(path := os.path.join(folder, name))]
            for path in (os.path.join(folder, name) for name in names):
                if os.path.isfile(path):
                    files[path] = fs.info(path)
                elif os.path.islink(path):  # it may be reachable in the next run
                    files[path] = {"size": 0}
    return files


def _in_folder(fs: Any, folder: str, infos: list[Info], storage: Storage, names: NamePattern) -> Iterator[Source]:
    """The recordings in one folder: what `recording.read` reads as one, and every other file."""
    paths = {info["name"]: PurePosixPath(info["name"]) for info in infos}
    whole: list[Info] = []
    bag = [i for i in infos if paths[i["name"]].suffix in _BAG]
    if bag and any(path.name == "metadata.yaml" for path in paths.values()):
        whole = bag + [i for i in infos if paths[i["name"]].suffix == ".yaml"]
    elif any(_PHASE.fullmatch(path.name) for path in paths.values()):
        whole = [i for i in infos if paths[i["name"]].suffix == ".npz"]
    if whole:
        yield _source(fs, whole, folder, storage, names)
    for info in infos:
        if info not in whole and paths[info["name"]].suffix.lower() in ENDINGS:
            yield _source(fs, [info], "", storage, names)


def _source(fs: Any, infos: list[Info], folder: str, storage: Storage, names: NamePattern) -> Source:
    path = folder or infos[0]["name"]
    url = path if _is_local(fs) or "://" in path else f"s3://{path}"
    version = version_of(infos)
    if len(infos) > 1 and version:
        listed = "\n".join(f"{info['name']} {version_of([info])}" for info in infos)
        version = hashlib.sha256(listed.encode()).hexdigest()[:16]
    return Source(
        url=url,
        files=tuple(info["name"] for info in infos),
        folder=folder,
        storage=storage,
        stage=names.stage(url),
        recorded_at=names.date(url, changed_at(infos)),
        version=version,
    )
