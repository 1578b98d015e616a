"""Encoding of figures: PNG and GIF files, and smaller WebP data URIs for the page."""

import base64
from dataclasses import dataclass
from io import BytesIO
from typing import overload

from PIL import Image

from validate.compare.exhibit import Animation, Picture

_GIF_COLOURS = 32  # line art: few colours and the steps between them


@dataclass(frozen=True)
class EncodedPicture(Picture):
    """A picture with its `file` and its data `uri`."""

    file: bytes = b""
    uri: str = ""


@dataclass(frozen=True)
class EncodedAnimation(Animation):
    """An animation with its `file` and its data `uri`."""

    file: bytes = b""
    uri: str = ""


@overload
def encoded(picture: Picture) -> EncodedPicture: ...
@overload
def encoded(picture: Picture | Animation) -> EncodedPicture | EncodedAnimation: ...
def encoded(picture: Picture | Animation) -> EncodedPicture | EncodedAnimation:
    """Return the picture as a PNG for the folder and a lossless WebP for the page (lossy for a
    photo), an animation as a GIF for both."""
    if isinstance(picture, EncodedPicture | EncodedAnimation):
        return picture
    own = vars(picture)
    if isinstance(picture, Animation):
        file = gif(picture)
        return EncodedAnimation(**own, file=file, uri=_data("gif", file))
    return EncodedPicture(**own, file=png(picture), uri=_data("webp", _webp(picture)))


def png(picture: Picture) -> bytes:
    """Return a PNG; line art in 256 colours, which it does not exceed visibly."""
    image = Image.fromarray(picture.pixels)
    if not picture.photo:
        image = image.quantize(256, dither=Image.Dither.NONE)
    out = BytesIO()
    image.save(out, "PNG", compress_level=6)  # 9 takes five times as long for 5 % less
    return out.getvalue()


def gif(animation: Animation) -> bytes:
    """Return an endless GIF in one palette, so that only what moves is stored again."""
    frames = [Image.fromarray(f) for f in animation.frames]
    palette = frames[0].quantize(_GIF_COLOURS, dither=Image.Dither.NONE)
    first, *others = [f.quantize(palette=palette, dither=Image.Dither.NONE) for f in frames]
    out = BytesIO()
    first.save(
        out, "GIF", save_all=True, append_images=others, duration=list(animation.milliseconds),
        loop=0, optimize=True,
    )  # fmt: skip
    return out.getvalue()


def uri(picture: Picture | Animation) -> str:
    """Return a data URI: GIF of what moves, else WebP, lossless for line art."""
    return encoded(picture).uri


def _webp(picture: Picture) -> bytes:
    out = BytesIO()
    how = {"quality": 86} if picture.photo else {"lossless": True, "quality": 60}
    Image.fromarray(picture.pixels).save(out, "WEBP", method=4, **how)
    return out.getvalue()


def _data(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64," + base64.b64encode(content).decode("ascii")
