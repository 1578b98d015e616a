"""Messages of a topic as plain values, of any writer."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from validate.errors import RecordingError, UsageError
from validate.recording.mcap.decoders import decoder_of
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.verified_file import messages_of, opened

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
