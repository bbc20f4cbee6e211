"""What only a real window can show; each test runs one script of `in_blender/`."""


def test_the_panel_opens_and_nothing_is_left_behind(blender):
    assert blender.run("smoke")["tab"] == "Skinwright"
