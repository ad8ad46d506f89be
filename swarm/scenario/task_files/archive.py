"""Files in a zip archive, unpacked within limits that are known before anything is unpacked.

Nothing is written to disk, and names are compared alone, so none can lead out of a folder. The
limits hold whatever the archive says of itself: no more bytes are unpacked than a file may have.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import PurePosixPath

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.files import LARGEST_FILE_BYTES
from swarm.scenario.findings import printable

_MOST_MEMBERS = 1000
_DIRECTORY_ENTRY = b"PK\x01\x02"
_PLAIN = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
_ENCRYPTED = 0x1
_GIVE = "give a zip archive as a map program saves it"


def member_of(data: bytes, suffix: str, source: str) -> bytes:
    """The first file in an archive whose name ends in ``suffix``.

    Raises:
        InputError: it is no archive, has no such file, or one larger than files may be.
    """
    members = members_of(data, [suffix], source)
    if not members:
        raise InputError(Fault(source, "", f"holds no {suffix} file", _GIVE))
    return next(iter(members.values()))


def members_of(
    data: bytes, suffixes: Collection[str], source: str, most_bytes: int = LARGEST_FILE_BYTES
) -> Mapping[str, bytes]:
    """All files in an archive whose names end in one of ``suffixes``, by name, as it has them.

    Together they have ``most_bytes`` at most.

    Raises:
        InputError: it is no archive, or too much to unpack.
    """
    # Before the list of members is read, which takes memory for each of them.
    if (count := data.count(_DIRECTORY_ENTRY)) > _MOST_MEMBERS:
        problem = f"holds {count} files, more than {_MOST_MEMBERS}"
        raise InputError(Fault(source, "", problem, _GIVE))
    found: dict[str, bytes] = {}
    left = most_bytes
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for info in archive.infolist():
                if PurePosixPath(info.filename.lower()).suffix not in suffixes:
                    continue
                _require_plain(info, source)
                with archive.open(info) as file:
                    content = file.read(left + 1)
                left -= len(content)
                if left < 0:
                    problem = f"unpacks to more than {most_bytes // 2**20} MiB"
                    where = printable(info.filename)
                    raise InputError(Fault(source, where, problem, "give a smaller one"))
                found[info.filename] = content
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError) as error:
        problem = f"is no zip archive that can be read: {printable(str(error)[:200])}"
        raise InputError(Fault(source, "", problem, _GIVE)) from error
    except (NotImplementedError, RuntimeError) as error:  # of another version, or split
        problem = f"is no plain zip archive: {printable(str(error)[:200])}"
        raise InputError(Fault(source, "", problem, _GIVE)) from error
    return found


def _require_plain(info: zipfile.ZipInfo, source: str) -> None:
    if info.flag_bits & _ENCRYPTED:
        problem, remedy = "is encrypted", "save it without a password"
    elif info.compress_type not in _PLAIN:
        problem, remedy = f"is packed by method {info.compress_type}", "pack it by deflate"
    else:
        return
    raise InputError(Fault(source, printable(info.filename), problem, remedy))
