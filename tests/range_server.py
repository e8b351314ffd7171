"""An HTTP server of a folder that serves ranges, breaks off, and counts its bytes."""

import http.server
import threading
from pathlib import Path
from types import TracebackType
from typing import Self


class RangeServer:
    """Serves a folder on this machine while the block lasts.

    Attributes:
        folder: What is served.
        break_after: Close the connection after so many bytes of a file; None = never.
        has_tags: Whether files have an ETag.
        requests: Path and Range header of each request.
        num_bytes: Bytes of files that were sent.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.break_after: int | None = None
        self.has_tags = True
        self.requests: list[tuple[str, str]] = []
        self.num_bytes = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}"

    def __enter__(self) -> Self:
        handler = type("Handler", (_Handler,), {"owner": self})
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Handler(http.server.BaseHTTPRequestHandler):
    owner: RangeServer

    def do_GET(self) -> None:
        asked = self.headers.get("Range", "")
        self.owner.requests.append((self.path, asked))
        path = self.owner.folder / self.path.lstrip("/")
        if not path.is_file():
            self.send_error(404)
            return
        data = path.read_bytes()
        tag = f'"{hash(data)}"' if self.owner.has_tags else ""
        start = 0
        if asked and tag and self.headers.get("If-Range") == tag:
            start = int(asked.removeprefix("bytes=").rstrip("-"))
        if start >= len(data) and start:
            self.send_response(416)
            self.send_header("Content-Range", f"bytes */{len(data)}")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        self.send_response(206 if start else 200)
        self.send_header("Content-Length", str(len(data) - start))
        if tag:
            self.send_header("ETag", tag)
        self.end_headers()
        sent = data[start:][: self.owner.break_after]
        self.owner.num_bytes += len(sent)
        self.wfile.write(sent)

    def log_message(self, *_: object) -> None:
        """Say nothing."""
