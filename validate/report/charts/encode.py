"""Encoding of figures: PNG files, and smaller WebP data URIs for the page."""

import base64
from dataclasses import dataclass
from io import BytesIO
from typing import overload

from PIL import Image

from validate.compare.exhibit import ImageSeries, Picture, Pixels

_WIDEST = 1000  # pixels of a photo on the page; its file has all


@dataclass(frozen=True)
class EncodedPicture(Picture):
    """A picture with its `file` and its data `uri`."""

    file: bytes = b""
    uri: str = ""


@dataclass(frozen=True)
class EncodedSeries(ImageSeries):
    """A series with the data `uris` of its images."""

    uris: tuple[str, ...] = ()


@overload
def encoded(picture: Picture) -> EncodedPicture: ...
@overload
def encoded(picture: Picture | ImageSeries) -> EncodedPicture | EncodedSeries: ...
def encoded(picture: Picture | ImageSeries) -> EncodedPicture | EncodedSeries:
    """Return the picture as a PNG for the folder and a lossless WebP for the page, lossy and at
    most `_WIDEST` wide for a photo; a series as lossy WebPs for the page."""
    if isinstance(picture, EncodedPicture | EncodedSeries):
        return picture
    own = vars(picture)
    if isinstance(picture, ImageSeries):
        return EncodedSeries(
            **own, uris=tuple(_webp(image, photo=True) for image in picture.images)
        )
    uri = _webp(picture.pixels, picture.photo)
    return EncodedPicture(**own, file=png(picture), uri=uri)


def png(picture: Picture) -> bytes:
    """Return a PNG; line art in 256 colours, which it does not exceed visibly."""
    image = Image.fromarray(picture.pixels)
    if not picture.photo:
        image = image.quantize(256, dither=Image.Dither.NONE)
    out = BytesIO()
    image.save(
        out, "PNG", compress_level=6, dpi=(picture.dpi, picture.dpi)
    )  # 9 takes five times as long for 5 % less
    return out.getvalue()


def uri(picture: Picture) -> str:
    """Return a data URI: WebP, lossless for line art."""
    return encoded(picture).uri


def _webp(pixels: Pixels, photo: bool) -> str:
    image, out = Image.fromarray(pixels), BytesIO()
    if photo and image.width > _WIDEST:
        image.thumbnail((_WIDEST, image.height), Image.Resampling.LANCZOS)
    how = {"quality": 76} if photo else {"lossless": True, "quality": 60}
    image.save(out, "WEBP", method=4, **how)
    return "data:image/webp;base64," + base64.b64encode(out.getvalue()).decode("ascii")
