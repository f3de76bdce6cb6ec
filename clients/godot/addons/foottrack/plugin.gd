@tool
extends EditorPlugin
## Nothing to set up: FoottrackClient, FoottrackBody and FoottrackHeadPublisher are in the list of nodes by their names.
