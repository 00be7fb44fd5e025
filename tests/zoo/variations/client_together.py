"""Liberties of clients that go together, so that each is seen beside others."""

from tests.zoo.mutant import together
from tests.zoo.variations import (
    client,
    client_adapted,
    client_channels,
    client_memory,
)


@together(
    client.members_that_nobody_knows,
    client.members_in_reverse_order,
    client.timestamps_everywhere,
    client.capabilities_of_tomorrow,
    client.token,
    client.numbers_with_exponents,
    client.escapes_everywhere,
    client.header_and_payload_apart,
)
def says_all_at_length(patch):
    """Spells its messages as nobody does, and says more than it has to."""


@together(
    client.versions_of_tomorrow,
    client.no_timestamps,
    client.requests_without_id,
    client.last_camera,
    client.white_space_everywhere,
)
def says_little(patch):
    """Leaves out what may be left out, and writes for people."""


@together(
    client.closes_on_what_is_broken,
    client.closes_after_every_error,
    client.insists_on_another_size,
    client.comes_back_at_an_even_pace,
    client.closes_on_frames_of_unknown_memory,
    client.closes_on_a_frame_that_it_cannot_use,
    client.subscribes_to_depth_alone,
    client.numbers_of_17_digits,
)
def bears_nothing(patch):
    """Closes the connection where it might ignore, and reads depth alone."""


@together(client.never_subscribes, client.says_all_of_1_1)
def asks_for_all_but_a_channel(patch):
    """Says everything on the message channel, and little on the other."""


@together(
    client.no_reinit, client.declares_nothing_on_the_message_channel, client.comes_back_slowly
)
def can_do_little(patch):
    """Declares few capabilities, and comes back slowly."""


@together(client.cuda_memory_alone, client.asks_once_a_process)
def opens_nothing_and_asks_once(patch):
    """Shows little of itself on either channel."""


@together(client.no_frames, client.the_same_id_in_every_request)
def opens_and_looks_away(patch):
    """Opens the memory, and has no use for it."""


@together(client.says_nothing_but_hello, client_channels.comes_back_late)
def comes_late_and_listens(patch):
    """Takes its time to connect, and says hello alone."""


@together(client.speaks_1_0, client_channels.one_channel_after_the_other)
def speaks_1_0_in_turn(patch):
    """Has one connection after the other, of 1.0."""


@together(client.images_alone, client.ends_with_its_server)
def looks_once(patch):
    """Looks at the images of one connection, and ends with it."""


@together(
    client_adapted.says_its_last_camera_again,
    client_adapted.moves_the_splats_as_an_object,
    client_adapted.asks_for_the_first_camera_ahead,
    client_adapted.steers_through_a_lens_of_its_own,
    client_adapted.converts_by_matrices_with_scale,
)
def steers_in_its_own_way(patch):
    """Says again what it said, through a lens of its own, and moves the splats by their name."""


@together(
    client.flushes_subnormal_numbers,
    client_memory.looks_for_frames_at_4_hz,
    client_memory.loads_its_driver_with_the_first_memory,
    client_memory.builds_its_shaders_with_the_first_frame,
)
def takes_its_time(patch):
    """Takes long for its first memory and its first frame, and shows few, without small numbers."""
