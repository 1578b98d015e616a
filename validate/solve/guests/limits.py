"""Takes limits upon itself and becomes the program that follows. Run by its path, alone.

python limits.py MEMORY_BYTES FILE_BYTES COMMAND [ARGUMENT ...]
"""

import os
import resource
import sys

if __name__ == "__main__":
    memory, size = int(sys.argv[1]), int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        os.execvp(sys.argv[3], sys.argv[3:])
    except OSError as error:
        print(f"{sys.argv[3]}: {error.strerror}")
        raise SystemExit(127) from None
