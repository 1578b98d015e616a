"""Pictures as files and as data URIs: PNG in the folder, the smaller WebP in the page."""

import base64
from io import BytesIO

from PIL import Image

from validate.report.page import Animation, Picture

_GIF_COLOURS = 32  # line art: few colours and the steps between them


def png(picture: Picture) -> bytes:
    """An optimised PNG; line art in 256 colours, which it does not exceed visibly."""
    image = Image.fromarray(picture.pixels)
    if not picture.photo:
        image = image.quantize(256, dither=Image.Dither.NONE)
    out = BytesIO()
    image.save(out, "PNG", optimize=True)
    return out.getvalue()


def data_uri(picture: Picture) -> str:
    """The picture as a WebP data URI: lossless for line art."""
    out = BytesIO()
    image = Image.fromarray(picture.pixels)
    if picture.photo:
        image.save(out, "WEBP", quality=86, method=4)
    else:
        image.save(out, "WEBP", lossless=True, quality=60, method=4)
    return "data:image/webp;base64," + base64.b64encode(out.getvalue()).decode("ascii")


def gif(animation: Animation) -> bytes:
    """An endless GIF in one palette, so that only what moves is stored again."""
    frames = [Image.fromarray(f) for f in animation.frames]
    palette = frames[0].quantize(_GIF_COLOURS, dither=Image.Dither.NONE)
    first, *others = [f.quantize(palette=palette, dither=Image.Dither.NONE) for f in frames]
    out = BytesIO()
    first.save(
        out, "GIF", save_all=True, append_images=others, duration=list(animation.milliseconds),
        loop=0, optimize=True,
    )  # fmt: skip
    return out.getvalue()


def gif_uri(animation: Animation) -> str:
    """The animation as a GIF data URI."""
    return "data:image/gif;base64," + base64.b64encode(gif(animation)).decode("ascii")
