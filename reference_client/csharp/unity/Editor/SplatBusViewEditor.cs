// SPDX-License-Identifier: MIT
namespace SplatBus.Unity.Editor
{
    using System.Globalization;
    using UnityEditor;
    using UnityEngine;

    /// <summary>Says below the fields what the view is connected to, and what is wrong.</summary>
    [CustomEditor(typeof(SplatBusView))]
    public sealed class SplatBusViewEditor : Editor
    {
        public override bool RequiresConstantRepaint() { return Application.isPlaying; }

        public override void OnInspectorGUI()
        {
            DrawDefaultInspector();
            var view = (SplatBusView)target;
            if (!Application.isPlaying || !view.isActiveAndEnabled)
            {
                EditorGUILayout.HelpBox("Connects in play mode.", MessageType.None);
                return;
            }
            ViewStatus status = view.Status;
            EditorGUILayout.HelpBox(Words(status), MessageType.Info);
            foreach (string problem in status.Problems) EditorGUILayout.HelpBox(problem, MessageType.Warning);
        }

        static string Words(ViewStatus status)
        {
            string server = status.Server ?? (status.Message == ChannelState.Old || status.Ipc == ChannelState.Old ? "a server of 1.0" : "no server yet");
            string channels = "images: " + Words(status.Ipc) + "; messages: " + Words(status.Message);
            string shown = status.Width == 0 ? "no image is shown" : string.Format(
                CultureInfo.InvariantCulture, "{0} x {1}, {2} images, the last {3:0.0} s ago", status.Width, status.Height, status.Images, status.AgeSeconds);
            return server + "\n" + channels + "\n" + shown;
        }

        static string Words(ChannelState state)
        {
            if (state == ChannelState.Away) return "not connected";
            if (state == ChannelState.Greeted) return "waiting for an answer";
            return state == ChannelState.Old ? "connected, 1.0" : "connected, 1.1";
        }
    }
}
