"""Liberties of servers that go together, so that each is seen beside others."""

from tests.zoo.mutant import together
from tests.zoo.variations import (
    server,
    server_1_1,
    server_blobs,
    server_images,
    server_messages,
    server_unhurried,
)


@together(
    server.server_members_that_nobody_knows,
    server.server_members_in_reverse_order,
    server_1_1.server_grants_in_another_order,
    server_1_1.server_counts_otherwise,
    server_messages.server_lists_every_object,
    server.server_numbers_with_exponents,
    server.server_escapes_everywhere,
    server.server_comes_with_cameras,
    server.server_sends_byte_by_byte,
)
def server_says_all_at_length(patch):
    """Spells its messages as nobody does, and says more than it has to."""


@together(
    server_1_1.server_reports_little,
    server_messages.server_has_nothing_to_tell,
    server.server_white_space_everywhere,
    server.server_comes_with_one_camera,
    server_messages.server_has_no_other_size,
    server_messages.server_is_cut_behind_a_header,
)
def server_says_little(patch):
    """Leaves out what may be left out, and writes for people."""


@together(
    server.server_closes_on_what_is_broken,
    server.server_takes_no_strings_for_numbers,
    server_1_1.server_alternates_colour_and_depth,
    server_messages.server_tells_lenses_in_single_precision,
    server.server_renders_slowly,
)
def server_bears_nothing(patch):
    """Closes where it might ignore; with a ring of its own."""


@together(
    server.server_ignores_broken_requests,
    server_1_1.server_reports_nothing_that_it_need_not,
    server_1_1.server_leaves_out_a_lens_that_was_not_granted,
    server_1_1.server_ignores_a_second_hello,
    server.server_tells_no_size_at_first,
    server.server_spaces_its_ring,
    server_images.server_that_renders_slowly,
    server.server_keeps_the_oldest_client,
    server_images.server_that_is_empty_at_100,
)
def server_bears_all(patch):
    """Ignores without a word what it might report; serves the oldest client alone."""


@together(
    server.server_keeps_many_clients,
    server_1_1.server_lends_to_many_readers,
    server_1_1.server_writes_colour_and_depth_always,
    server_messages.server_of_many_objects,
)
def server_of_many(patch):
    """Serves many clients, with many slots and many objects."""


@together(
    server.server_keeps_two_connections,
    server.server_goes_home,
    server_messages.server_takes_its_time_for_a_size,
    server_1_1.server_has_one_name_for_its_memory,
    server_unhurried.server_of_one_small_splat,
)
def server_keeps_few(patch):
    """Serves two clients a channel, forgets where they were, and shows little."""


@together(
    server_images.server_with_an_odd_lens,
    server_images.server_in_single_precision,
    server_1_1.server_republishes_for_each_reader,
)
def server_sees_otherwise(patch):
    """Has a lens of its own, a matrix of single precision, and more images than it needs."""


@together(
    server.server_without_reinit,
    server_messages.server_of_lenses_and_pings,
    server_images.server_of_another_scene,
)
def server_can_do_little(patch):
    """Has few capabilities on either channel."""


@together(server.server_without_frames, server_messages.server_of_objects_alone)
def server_can_do_less(patch):
    """Has the fewest capabilities of those that share memory."""


@together(
    server_unhurried.server_takes_long_for_its_first_image,
    server_unhurried.server_of_many_slots,
    server.server_turns_its_scene,
)
def server_takes_long_at_first(patch):
    """Takes long for its first image, and much memory; the scene turns meanwhile."""


@together(
    server.server_keeps_the_newest_client,
    server_images.server_that_begins_elsewhere,
    server_images.server_of_distances,
    server_messages.server_of_telemetry_and_sizes,
)
def server_of_the_newest_client(patch):
    """Serves one client, the newest, with distances, and begins elsewhere."""


@together(server.server_lends_to_one_reader, server_blobs.server_of_sparse_soft_blobs)
def server_lends_soft_blobs(patch):
    """Lends to one reader what one sees through."""


@together(server_1_1.server_speaks_1_1_alone, server_images.server_without_alpha)
def server_of_a_full_sky(patch):
    """Refuses 1.0, and leaves no pixel empty."""


@together(
    server_messages.server_without_message_capabilities, server_blobs.server_of_one_large_blob
)
def server_of_one_blob_and_nothing_to_say(patch):
    """Lends images of one depth, and has nothing to say."""
