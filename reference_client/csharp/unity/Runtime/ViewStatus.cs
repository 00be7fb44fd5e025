// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    /// <summary>What a <see cref="SplatBusView"/> is connected to, and what is wrong, at one moment.</summary>
    public struct ViewStatus
    {
        /// <summary>As the server names itself; null where it speaks 1.0, or none is there.</summary>
        public string Server;
        public ChannelState Ipc, Message;
        /// <summary>Of the image that is shown, in pixels; 0 where none is.</summary>
        public int Width, Height;
        /// <summary>How many were taken since the component was enabled.</summary>
        public long Images;
        /// <summary>Since the image that is shown was taken; infinity where none is.</summary>
        public double AgeSeconds;
        /// <summary>In words, each a sentence or two; empty where all is well.</summary>
        public string[] Problems;
    }
}
