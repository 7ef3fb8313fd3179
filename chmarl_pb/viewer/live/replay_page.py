"""An episode in 3D as one file: a page that plays it without a server or a network."""

from chmarl_pb.frames.motion_player import Replay
from chmarl_pb.frames.recording import Recording
from chmarl_pb.viewer.film import FRAME_RATE
from chmarl_pb.viewer.live.gate import Gate, guarded_server, stop
from chmarl_pb.viewer.live.house import House

_STRIDE, _PAUSE, _IMAGE = 4, 0.5, 128  # motions at four times the speed, seconds between steps, pixels


def replay_page(recording: Recording) -> str:
    """Return a page that plays a recording in 3D, with viser's own player in it.

    Args:
        recording: the episode.
    """
    server = guarded_server(Gate(), "127.0.0.1", 0)  # viser records what it would send; nobody knows the token
    try:
        house, replay = House(server, recording, lambda name: None), Replay(recording.home, recording.team)
        film = server.get_scene_serializer()
        for moment in recording.moments:
            for scene in moment.motion[::_STRIDE]:
                house.show(scene)
                film.insert_sleep(1 / FRAME_RATE)
            house.show(moment.rest)
            house.show_pictures({name: replay.picture(name, moment.rest, _IMAGE) for name in recording.models})
            film.insert_sleep(_PAUSE)
        page: str = film.as_html()
        return page
    finally:
        stop(server)
