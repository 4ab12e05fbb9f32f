"""The commands that write a file for elsewhere: new, export."""

from pathlib import Path

from cyclopts import App

from ..terminal import Answer, Models, Output, new_scene


def add_file_commands(app: App) -> None:
    """Let the command line know these commands."""
    for command in (new, export):
        app.command(command)


def new(name: str, file: Path, *, output: Output = Output()) -> Answer:
    """A commented scene file to start from.

    Parameters
    ----------
    name
        Kind of rotor: tilt, horizontal, vertical or magnets.
    file
        Where to write it; an existing file is left alone.
    """
    path = new_scene(name, file)
    said = f"Written: {path}. Next: spinlev run {path}"
    return Answer({"file": str(path)}, [said], output.json)


def export(scene: Path, file: Path, *, asked: Models = Models(), output: Output = Output()) -> Answer:
    """B, H and M inside and around the bodies, and J in the plate, for ParaView.

    Parameters
    ----------
    scene
        Scene file.
    file
        File to write, OUT.vtu.
    """
    from ...geometry.scenes import load_scene

    loaded = load_scene(scene)
    from ..exchange import export_job

    return Answer(*export_job(loaded, asked.checked(), file), output.json)
