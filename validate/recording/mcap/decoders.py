"""Decoders of third-party messages (ROS 2 CDR, Protobuf, JSON, CBOR) and a topic's messages as
dicts.

Numbers stay numbers, texts texts, bytes bytes, lists lists; times of Protobuf become {sec, nsec}.
"""

import base64
import io
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from itertools import islice
from pathlib import Path
from typing import Any

from mcap.records import Schema as TheirSchema

from validate.errors import RecordingError, UsageError
from validate.files import json_value
from validate.installation import install_command
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.records import Channel, Schema, messages_of, opened

Plain = dict[str, Any]
Decoder = Callable[[bytes], Plain]
MAX_MESSAGE = 64 * 2**20  # bytes of one message
_TIMES = ("google.protobuf.Timestamp", "google.protobuf.Duration")


def decoder_of(schema: Schema | None, channel: Channel) -> Decoder | str:
    """Return the decoder of a channel's messages, or the reason for none."""
    encodings = (schema.encoding if schema else "", channel.encoding)
    try:
        if encodings == ("ros2msg", "cdr") and schema is not None:
            from mcap_ros2.decoder import DecoderFactory as Ros2

            # Its library prints what it cannot parse.
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                decode = Ros2().decoder_for("cdr", _theirs(schema))
            return _of_library(decode, _plain_ros2, "ROS 2 message definition")
        if encodings == ("protobuf", "protobuf") and schema is not None:
            from mcap_protobuf.decoder import DecoderFactory as Protobuf

            parse = Protobuf().decoder_for("protobuf", _theirs(schema))
            return _of_library(parse, _plain_protobuf, "Protobuf schema")
        if channel.encoding == "json":
            return _guarded(_json)
        if channel.encoding == "cbor":
            import cbor2

            return _guarded(cbor2.loads)
    except ImportError as missing:
        return f"the library '{missing.name}' that reads it is not installed; {install_command()}"
    except Exception as error:  # a schema that its own library cannot parse
        return f"its schema cannot be parsed ({_line(error)})"
    return f"no decoder for '{'/'.join(encodings)}'"


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


def _guarded(decode: Callable[[bytes], Any]) -> Decoder:
    """One typed error for whatever a library raises on damage, and for what is no object."""

    def guarded(data: bytes) -> Plain:
        if len(data) > MAX_MESSAGE:
            raise RecordingError(f"a message of {len(data)} bytes, the limit is {MAX_MESSAGE}")
        try:
            found = decode(data)
        except RecordingError:
            raise
        except Exception as error:
            raise RecordingError(f"damaged ({_line(error)})") from None
        if not isinstance(found, dict):
            raise RecordingError(f"{type(found).__name__}, expected an object with fields")
        return found

    return guarded


def _theirs(schema: Schema) -> TheirSchema:
    return TheirSchema(schema.id, schema.data, schema.encoding, schema.name)


def _of_library(
    decode: Callable[[bytes], Any] | None, plain: Callable[[Any], Any], lacks: str
) -> Decoder:
    if decode is None:
        raise RecordingError(f"no {lacks}")
    return _guarded(lambda data: plain(decode(data)))


def _plain_ros2(value: Any) -> Any:
    slots = getattr(value, "__slots__", None)
    if slots is not None:
        return {name: _plain_ros2(getattr(value, name)) for name in slots}
    if isinstance(value, (list, tuple)) and value and hasattr(value[0], "__slots__"):
        return [_plain_ros2(item) for item in value]
    return value


def _plain_protobuf(message: Any) -> Any:
    if message.DESCRIPTOR.full_name in _TIMES:
        return {"sec": message.seconds, "nsec": message.nanos}
    found = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        nested = field.message_type is not None
        if not isinstance(value, (str, bytes)) and hasattr(value, "__len__"):
            found[field.name] = [_plain_protobuf(v) if nested else v for v in value]
        else:
            found[field.name] = _plain_protobuf(value) if nested else value
    return found


def _json(data: bytes) -> Any:
    return json_value(data.decode("utf-8"))


def binary(value: Any) -> bytes:
    """Return the bytes of a field: as they are, as a list of numbers, or base64 in JSON."""
    if isinstance(value, str):
        try:
            return base64.b64decode(value, validate=True)
        except ValueError as error:
            raise RecordingError(f"not base64 ({error})") from None
    try:
        return bytes(value)
    except (TypeError, ValueError) as error:
        raise RecordingError(f"not bytes ({error})") from None


LONGEST = 64  # elements of a list that are shown


def messages_in(path: Path, topic: str, most: int) -> Iterator[dict[str, Any]]:
    """Log and publish time (ns) and fields of the first `most` messages of a topic.

    Bytes and long lists are shortened, and say so. Raises `UsageError` for a topic that is not
    there, `RecordingError` for one that nothing here decodes, and a damaged file or message.
    """
    with opened(path) as stream:
        verified = verify(stream, path)
        found = {i: c for i, c in verified.channels.items() if c.topic == topic}
        if not found:
            there = ", ".join(sorted(c.topic for c in verified.channels.values())) or "none"
            raise UsageError(f"{path.name}: no topic '{topic}'; topics: {there}")
        decoders = {i: decoder_of(verified.schemas.get(c.schema_id), c) for i, c in found.items()}
        for message in islice(messages_of(stream, verified, found.keys()), most):
            decode = decoders[message.channel_id]
            if isinstance(decode, str):
                raise RecordingError(f"{path.name}: {topic}: {decode}")
            yield {
                "log_ns": message.log_ns,
                "publish_ns": message.publish_ns,
                "message": shortened(decode(message.data)),
            }


def shortened(value: Any) -> Any:
    """As JSON can hold it: bytes by their count, numbers that are not finite as texts."""
    if isinstance(value, dict):
        return {str(k): shortened(v) for k, v in value.items()}
    if isinstance(value, (bytes, bytearray, memoryview)):
        return f"{len(value)} bytes"
    if isinstance(value, (list, tuple)) or hasattr(value, "tolist"):
        listed = list(value)
        rest = [f"... {len(listed)} in all"] if len(listed) > LONGEST else []
        return [shortened(v) for v in listed[:LONGEST]] + rest
    if isinstance(value, float) and not abs(value) < float("inf"):
        return str(value)
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)
