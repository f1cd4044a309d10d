"""Where the package's configuration, weights and data lie."""

from __future__ import annotations

from pathlib import Path

PACKAGE = "kmn_perception"


def share_directory() -> Path:
    """Return the installed share of this package, or its source folder in a checkout."""
    source = Path(__file__).resolve().parents[2]
    if (source / "package.xml").is_file():
        return source
    from ament_index_python.packages import get_package_share_directory

    return Path(get_package_share_directory(PACKAGE))


def find(
    kind: str, name_or_path: str | Path, suffix: str = ".yaml", folder: Path | None = None
) -> Path:
    """Return the file of a shipped name, or the user's own file.

    Parameters
    ----------
    kind
        Folder below the share, e.g. ``config/models``, ``config/cameras`` or ``weights``.
    name_or_path
        A shipped name such as ``door``, or a path to a file.
    suffix
        Ending of the shipped files.
    folder
        From where a relative path leads; ``None``: from the working directory.

    Raises
    ------
    FileNotFoundError
        If there is neither a file at that path nor a shipped one of that name.
    """
    own, ours = (folder or Path()) / name_or_path, share_directory() / kind
    for candidate in (own, ours / f"{name_or_path}{suffix}"):
        if candidate.is_file():
            return candidate
    shipped = ", ".join(sorted(path.stem for path in ours.glob(f"*{suffix}"))) or "none"
    raise FileNotFoundError(
        f"'{name_or_path}' is neither a file nor one of the shipped {kind} ({shipped})"
    )
