"""The pages that look on. A slow one misses frames; it never holds up the flight, nor the others."""

import asyncio
from collections import deque
from itertools import count

from starlette.websockets import WebSocket

MAX_WAITING = 1000  # messages that must not be missed; a page that lets more pile up is let go
FRAME = b'{"k":"f"'


class Page:
    """One page: what it must be told, in order, and the newest frame."""

    def __init__(self, number: int, socket: WebSocket) -> None:
        self.number, self._socket = number, socket
        self._waiting: deque[bytes] = deque()
        self._frame: bytes | None = None
        self._news = asyncio.Event()

    def tell(self, told: bytes) -> None:
        """Have it sent as soon as the page takes it."""
        if told.startswith(FRAME):
            self._frame = told
        else:
            if not self._waiting:
                self._flush_frame_first()
            self._waiting.append(told)
        self._news.set()

    def _flush_frame_first(self) -> None:
        """A frame flown before an event is drawn before it, and one of another flight not after its hello."""
        if self._frame is not None:
            self._waiting.append(self._frame)
            self._frame = None

    async def send(self) -> None:
        """Send until the page is gone."""
        while len(self._waiting) < MAX_WAITING:
            await self._news.wait()
            self._news.clear()
            while self._waiting:
                await self._socket.send_text(self._waiting.popleft().decode())
            if self._frame is not None:
                frame, self._frame = self._frame, None
                await self._socket.send_text(frame.decode())


class Pages:
    """All of them."""

    def __init__(self) -> None:
        self._pages: dict[int, Page] = {}
        self._numbers = count(1)

    def __len__(self) -> int:
        return len(self._pages)

    def add(self, socket: WebSocket) -> Page:
        """A page more."""
        page = Page(next(self._numbers), socket)
        self._pages[page.number] = page
        return page

    def remove(self, page: Page) -> None:
        """It is gone."""
        self._pages.pop(page.number, None)

    def tell(self, number: int, told: bytes) -> None:
        """Tell one page, or with 0 all of them."""
        chosen = [self._pages.get(number)] if number else list(self._pages.values())
        for page in chosen:
            if page is not None:
                page.tell(told)
